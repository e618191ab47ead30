//! Where beds stop growing because their heat ends.

use serde::Serialize;

use super::curve::{Band, Curve, Target};
use super::draws::Draw;
use crate::input::scene_file::SceneInput;
use crate::number::significant;
use crate::pair::heat::GrowthSeen;

/// Where the beds stop growing because their heat ends.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Freezing {
    /// The target's quantity there; none unless all draws whose heat ends have come to rest: those that rest first would say too little.
    pub at: Option<Band>,
    /// The least and the largest of it, over the draws that have come to rest; none where none has.
    pub between: Option<[f64; 2]>,
    /// Draws that have come to rest.
    pub draws: usize,
    /// Those of them that are below the target then.
    pub below: usize,
    /// Draws whose heat ends after the heated phases of the scene.
    pub later: usize,
    /// Draws whose bed ended before, where necks meet or pores close.
    pub stopped: usize,
}

impl Freezing {
    /// Of the beds of draws; none where no heat ends.
    pub(super) fn of(
        computed: &[(Draw, Curve)],
        target: Target,
        input: &SceneInput,
    ) -> Option<Self> {
        let whole_s = input.heated_s(f64::INFINITY).last().map_or(0.0, |[_, end]| *end);
        let (mut ends, mut later, mut stopped) = (Vec::new(), 0, 0);
        for (draw, curve) in computed {
            let (Some(heat), Some(last)) = (&draw.heat, curve.moments.last()) else { continue };
            let growth = GrowthSeen::of(heat, &input.heated_s(last.time_s));
            match growth.in_all_s {
                None => {}
                // A full bed has nowhere to go.
                Some(_) if growth.is_frozen() || last.relative_density >= 1.0 => {
                    ends.push(last.of_target(target));
                }
                Some(_) if last.time_s < (1.0 - 1e-9) * whole_s => stopped += 1,
                Some(_) => later += 1,
            }
        }
        let draws = ends.len();
        let least = ends.iter().copied().reduce(f64::min);
        let between = least.zip(ends.iter().copied().reduce(f64::max)).map(|(a, b)| [a, b]);
        let below = ends.iter().filter(|end| **end < target.value()).count();
        let at = if later + stopped == 0 { Band::of(ends.into_iter()) } else { None };
        let found = Self { at, between, draws, below, later, stopped };
        (draws + later + stopped > 0).then_some(found)
    }

    /// As lines of the summary; of all `draws` so many come `late`: they do not reach the target, though their pairs have not ended.
    pub(super) fn lines(&self, target: Target, (late, draws): (usize, usize)) -> Vec<String> {
        let interval =
            |[low, high]: [f64; 2]| format!("{} .. {}", significant(low, 3), significant(high, 3));
        let name = target.name();
        let mut lines = Vec::new();
        if let Some(at) = &self.at {
            lines.push(format!(
                "  it freezes at a {name} of {} (50 % {}, 90 % {})",
                significant(at.median, 3),
                interval(at.eti50),
                interval(at.eti90)
            ));
        } else if let Some(between) = self.between {
            lines.push(format!(
                "  {} of {draws} draws have come to rest, at a {name} of {}",
                self.draws,
                interval(between)
            ));
        }
        let below = self.below.min(late);
        let mut tell = |count: usize, what: &str| {
            if count > 0 {
                lines.push(format!("    {count} of {draws} draws {what}"));
            }
        };
        tell(below, "freeze below the target and count as later than all others");
        tell(
            late - below,
            "do not reach it within the scene's time and count as later than all others",
        );
        tell(
            self.later,
            "have a heat that ends after the heated phases: a scene that is heated for longer says where they freeze",
        );
        tell(self.stopped, "end where necks meet or pores close, before their heat does");
        lines
    }
}
