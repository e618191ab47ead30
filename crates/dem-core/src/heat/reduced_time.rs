//! The integral of the mobility, followed through time.

use super::piece::Piece;

/// The reduced time at the present, which moves forward.
pub(super) struct Walk<'a> {
    pieces: &'a [Piece],
    /// Where the present piece began, or contact if that was later \[s\].
    piece_s: f64,
    /// s there.
    piece_reduced: f64,
    now_s: f64,
    reduced: f64,
}

impl<'a> Walk<'a> {
    /// At first contact.
    pub(super) fn new(pieces: &'a [Piece]) -> Self {
        let past = pieces.partition_point(|piece| piece.until_s <= 0.0);
        Self { pieces: &pieces[past..], piece_s: 0.0, piece_reduced: 0.0, now_s: 0.0, reduced: 0.0 }
    }

    /// s at a time, at or after the present.
    pub(super) fn to(&mut self, time_s: f64) -> f64 {
        while let Some(piece) = self.pieces.first()
            && piece.until_s < time_s
        {
            self.within(piece, piece.until_s);
            self.next();
        }
        if let Some(piece) = self.pieces.first() {
            self.within(piece, time_s);
        }
        self.reduced
    }

    /// The time at which s has a value: 0 for values up to 0, `None` where it never has.
    pub(super) fn time(pieces: &[Piece], reduced: f64) -> Option<f64> {
        if reduced <= 0.0 {
            return Some(0.0);
        }
        Walk::new(pieces).until(reduced).filter(|time| time.is_finite())
    }

    fn until(mut self, reduced: f64) -> Option<f64> {
        while let Some(piece) = self.pieces.first() {
            self.within(piece, piece.until_s);
            if self.reduced >= reduced {
                let more = reduced - self.piece_reduced;
                return Some(piece.course.time_after(self.piece_s, piece.until_s, more));
            }
            self.next();
        }
        None
    }

    fn next(&mut self) {
        self.pieces = &self.pieces[1..];
        (self.piece_s, self.piece_reduced) = (self.now_s, self.reduced);
    }

    /// Closed forms are taken from the beginning of their piece, so that they do not depend on the times in between.
    fn within(&mut self, piece: &Piece, time_s: f64) {
        self.reduced = if piece.course.is_closed() {
            let more = piece.course.integral(self.piece_s, time_s, 0.0);
            self.piece_reduced + more
        } else {
            self.reduced + piece.course.integral(self.now_s, time_s, self.reduced)
        };
        self.now_s = time_s;
    }
}
