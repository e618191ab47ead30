//! The regime map of a/R against time: eqs. 3 to 5, as in Figure 2 of the paper.
use super::axis::{Axis, Scale};
use super::elements::Look;
use super::header::{Swatch, header};
use super::layout::{Spec, TITLE_SIZE, layout};
use super::page::Page;
use super::palette::{BLACK, GREY, Marker, Pen, opaque};
use super::text::anchor;
use super::{Columns, PlotError, Role};

/// Adhesive contact, zipping and stretching, with the two points where one hands over to the next.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RegimeMapFigure {
    /// Heading; empty for none.
    pub title: String,
    /// Times of the lines (s), positive and increasing.
    pub grid_s: Vec<f64>,
    /// a0/R (eq. 3), a constant.
    pub a0: f64,
    /// a1/R (eq. 4), one per grid time.
    pub a1: Vec<f64>,
    /// a2/R (eq. 5), one per grid time.
    pub a2: Vec<f64>,
    /// p1 = (time (s), a/R), where a0 meets a1.
    pub p1: Option<(f64, f64)>,
    /// p2 = (time (s), a/R), where a1 meets a2.
    pub p2: Option<(f64, f64)>,
    /// a/R at which growth stops; drawn as a line.
    pub final_ratio: Option<f64>,
    /// Measurements to lay over the map: times (s); may be empty.
    pub data_time_s: Vec<f64>,
    /// Measurements to lay over the map: a/R.
    pub data_ratio: Vec<f64>,
}

impl RegimeMapFigure {
    pub(super) fn draw(&self, page: &Page) -> Result<(), PlotError> {
        let columns = Columns("regime map");
        columns.need("a1", &self.a1, self.grid_s.len(), "grid time")?;
        columns.need("a2", &self.a2, self.grid_s.len(), "grid time")?;
        columns.need("data_ratio", &self.data_ratio, self.data_time_s.len(), "time")?;

        let a0 = vec![self.a0; self.grid_s.len()];
        let stages = [
            (&a0, Role::Series(0), "adhesive contact a_{0}"),
            (&self.a1, Role::Series(1), "zipping a_{1} ~ t^{1/7}"),
            (&self.a2, Role::Series(3), "stretching a_{2} ~ t^{1/2}"),
        ];
        let envelope: Vec<f64> = (0..self.grid_s.len())
            .map(|i| {
                let a = self.a0.max(self.a1[i]).max(self.a2[i]);
                self.final_ratio.map_or(a, |end| a.min(end))
            })
            .collect();
        let wide = Pen::solid(opaque(0xd9d9d9), 4.0);
        let mut entries: Vec<_> = stages
            .iter()
            .map(|(_, role, name)| ((*name).to_owned(), Swatch::Line(role.pen())))
            .collect();
        entries.push(("largest of the three".to_owned(), Swatch::Line(wide)));
        if !self.data_time_s.is_empty() {
            entries.push(("measured".to_owned(), Swatch::measurement()));
        }
        let top = header(page, &self.title, &entries)?;

        let points = [self.p1, self.p2];
        let marked = points.iter().flatten();
        let times = self
            .grid_s
            .iter()
            .copied()
            .chain(marked.clone().map(|p| p.0))
            .chain(self.data_time_s.iter().copied());
        let x = Axis::holding("time t", "s", Scale::Log, times, 0.01);
        let heights = envelope
            .iter()
            .chain(&self.data_ratio)
            .copied()
            .chain(marked.clone().map(|p| p.1))
            .chain(self.final_ratio);
        let y = Axis::holding("contact ratio a/R", "", Scale::Log, heights, 0.1);
        let height = page.of_width(140.0, 230.0);
        let panels = layout(page, top, 8.0, &[(height, vec![Some(Spec::new(x, y))])])?;
        let Some(panel) = panels.into_iter().flatten().flatten().next() else { return Ok(()) };
        panel.line(&self.grid_s, &envelope, wide)?;
        if let Some(end) = self.final_ratio {
            panel.across(end, Pen::dashed(GREY, 0.6, &[1.2, 1.4]))?;
        }
        for (values, role, _) in &stages {
            panel.line(&self.grid_s, values, role.pen())?;
        }
        panel.data(&self.data_time_s, &self.data_ratio)?;
        // Above p1 on the left and below p2 on the right nothing runs; near an edge the other side is taken.
        let below = ((4.5, 4.0), anchor::TOP_LEFT);
        let above = ((-3.5, -4.5), anchor::BOTTOM_RIGHT);
        for (point, name, sides) in
            [(self.p1, "p_{1}", [above, below]), (self.p2, "p_{2}", [below, above])]
        {
            let Some((time_s, ratio)) = point else { continue };
            let ink = BLACK;
            panel.markers(&[time_s], &[ratio], Look::filled(Marker::Circle, 2.2, ink))?;
            let Some((x, y)) = panel.on_page(time_s, ratio) else {
                continue;
            };
            let Some(inner) = panel.inner(1.0) else { continue };
            for ((dx, dy), anchor) in sides {
                if page.text_where_free(name, TITLE_SIZE, (x + dx, y + dy), anchor, &inner)? {
                    break;
                }
            }
        }
        Ok(())
    }
}
