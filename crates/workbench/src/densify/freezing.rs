//! Where beds stop growing because their heat ends.

use serde::Serialize;

use super::curve::{Band, Curve, Target};
use super::draws::Draw;
use crate::number::significant;
use crate::pair::heat::GrowthSeen;

/// Where the beds stop growing because their heat ends.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Freezing {
    /// The target's quantity there, over the draws that have come to rest; none where none has.
    pub at: Option<Band>,
    /// Draws that have come to rest.
    pub draws: usize,
    /// Those of them that are below the target then.
    pub below: usize,
    /// Draws whose heat ends too, but after the run of their bed.
    pub later: usize,
}

impl Freezing {
    /// Of the beds of draws; none where no heat ends.
    pub(super) fn of(computed: &[(Draw, Curve)], target: Target) -> Option<Self> {
        let (mut ends, mut later) = (Vec::new(), 0);
        for (draw, curve) in computed {
            let (Some(heat), Some(last)) = (&draw.heat, curve.moments.last()) else { continue };
            let growth = GrowthSeen::of(heat, last.time_s);
            match growth.in_all_s {
                None => {}
                // A full bed has nowhere to go.
                Some(_) if growth.is_frozen() || last.relative_density >= 1.0 => {
                    ends.push(last.of_target(target));
                }
                Some(_) => later += 1,
            }
        }
        let (draws, below) = (ends.len(), ends.iter().filter(|end| **end < target.value()).count());
        let at = Band::of(ends.into_iter());
        (draws + later > 0).then_some(Self { at, draws, below, later })
    }

    /// As lines of the summary; of all `draws` so many come `late`: they do not reach the target, though their pairs have not ended.
    pub(super) fn lines(&self, target: Target, (late, draws): (usize, usize)) -> Vec<String> {
        let interval =
            |[low, high]: [f64; 2]| format!("{} .. {}", significant(low, 3), significant(high, 3));
        let mut lines = Vec::new();
        if let Some(at) = &self.at {
            let of = match self.later {
                0 => String::new(),
                _ => format!(", for the {} of {draws} draws that come to rest", self.draws),
            };
            lines.push(format!(
                "  it freezes at a {} of {} (50 % {}, 90 % {}){of}",
                target.name(),
                significant(at.median, 3),
                interval(at.eti50),
                interval(at.eti90)
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
            "grow still at the end of their run: a scene that lasts longer says where they freeze",
        );
        lines
    }
}
