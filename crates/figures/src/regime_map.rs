//! The regime map of a/R over time: eqs. 3 to 5, as in Figure 2 of the paper.

use crate::columns::Columns;
use crate::drawing::{Axis, BLACK, GREY, Look, Marker, Page, Pen, Role, Scale, Spec, Swatch};
use crate::drawing::{TITLE_SIZE, anchor, header, one_panel, opaque};
use crate::error::PlotError;
use crate::figure::Figure;

/// Adhesive contact, zipping and stretching, with the two points where one stage gives way to the next.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RegimeMapFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Times of the lines \[s\], positive and increasing.
    pub grid_s: Vec<f64>,
    /// a0/R (eq. 3), a constant.
    pub a0: f64,
    /// a1/R (eq. 4), one per grid time.
    pub a1: Vec<f64>,
    /// a2/R (eq. 5), one per grid time.
    pub a2: Vec<f64>,
    /// p1 = (time \[s\], a/R), where a0 meets a1.
    pub p1: Option<(f64, f64)>,
    /// p2 = (time \[s\], a/R), where a1 meets a2.
    pub p2: Option<(f64, f64)>,
    /// a/R at which growth stops; drawn as a line.
    pub final_ratio: Option<f64>,
    /// Times of the measurements \[s\]; may be empty.
    pub data_time_s: Vec<f64>,
    /// Measured a/R, one per time.
    pub data_ratio: Vec<f64>,
}

impl Figure for RegimeMapFigure {
    fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("regime map");
        columns.need("a1", &self.a1, (self.grid_s.len(), "grid time"))?;
        columns.need("a2", &self.a2, (self.grid_s.len(), "grid time"))?;
        columns.need("data_ratio", &self.data_ratio, (self.data_time_s.len(), "time"))?;

        let a0 = vec![self.a0; self.grid_s.len()];
        let stages = [
            (&a0, Role::Series(0), "adhesive contact a_{0}"),
            (&self.a1, Role::Series(1), "zipping a_{1} ~ t^{1/7}"),
            (&self.a2, Role::Series(3), "stretching a_{2} ~ t^{1/2}"),
        ];
        let lines = self.a1.iter().zip(&self.a2);
        let envelope: Vec<f64> = lines
            .map(|(a1, a2)| self.a0.max(*a1).max(*a2))
            .map(|a| self.final_ratio.map_or(a, |end| a.min(end)))
            .collect();
        let change = Look::filled(Marker::Square, 2.0, BLACK);
        let wide = Pen::solid(opaque(0xd9d9d9), 4.0);
        let mut entries: Vec<_> =
            stages.iter().map(|(_, role, name)| (*name, Swatch::Line(role.pen()))).collect();
        entries.push(("largest of the three", Swatch::Line(wide)));
        let end = Pen::dashed(GREY, 0.8, &[1.2, 1.4]);
        if self.final_ratio.is_some() {
            entries.push(("final a/R", Swatch::Line(end)));
        }
        if self.p1.or(self.p2).is_some() {
            entries.push(("change of stage", Swatch::Point(change)));
        }
        if !self.data_time_s.is_empty() {
            entries.push(("measured", Swatch::measurement()));
        }
        let top = header(page, &self.title, &entries)?;

        let (marked_s, marked): (Vec<f64>, Vec<f64>) =
            [self.p1, self.p2].into_iter().flatten().unzip();
        let times = self.grid_s.iter().chain(&marked_s).chain(&self.data_time_s).copied();
        let x = Axis::holding("time t", "s", Scale::Log, times, 0.01);
        let heights = envelope.iter().chain(&self.data_ratio).chain(&marked);
        let heights = heights.chain(&self.final_ratio).copied();
        let y = Axis::holding("contact ratio a/R", "", Scale::Log, heights, 0.1);
        let Some(panel) = one_panel(page, top, Spec::new(x, y))? else { return Ok(()) };
        panel.line(&self.grid_s, &envelope, wide)?;
        if let Some(ratio) = self.final_ratio {
            panel.across(ratio, end)?;
        }
        for (values, role, _) in &stages {
            panel.line(&self.grid_s, values, role.pen())?;
        }
        panel.data(&self.data_time_s, &self.data_ratio)?;
        // No line runs above p1 on the left or below p2 on the right; near an edge the other side is taken.
        let below = ((4.5, 4.0), anchor::TOP_LEFT);
        let above = ((-3.5, -4.5), anchor::BOTTOM_RIGHT);
        for (point, name, sides) in
            [(self.p1, "p_{1}", [above, below]), (self.p2, "p_{2}", [below, above])]
        {
            let Some((time_s, ratio)) = point else { continue };
            panel.mark(time_s, ratio, change)?;
            let (Some((x, y)), Some(inner)) = (panel.on_page(time_s, ratio), panel.inner(1.0))
            else {
                continue;
            };
            for ((dx, dy), anchor) in sides {
                if page.text_where_free(name, TITLE_SIZE, (x + dx, y + dy), anchor, &inner)? {
                    break;
                }
            }
        }
        Ok(())
    }
}
