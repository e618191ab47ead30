//! JSON objects that carry their own checksum, so that damage is seen.
//!
//! The last field of a sealed object is `"checksum"`: CRC-64 (as in XZ) of all bytes before it, which
//! finds every damage of up to 64 bits in a row, and misses any other with a chance of 2^-64.

use crc::{CRC_64_XZ, Crc};
use serde::Serialize;
use serde::de::DeserializeOwned;

static CRC: Crc<u64> = Crc::<u64>::new(&CRC_64_XZ);

const FIELD: &[u8] = b",\"checksum\":\"";
const END: &[u8] = b"\"}";
const DIGITS: usize = 16;

/// A checksum over several pieces of data.
pub(crate) struct Digest(crc::Digest<'static, u64>);

impl Digest {
    pub(crate) fn new() -> Self {
        Self(CRC.digest())
    }

    /// Adds a piece, with its length, so that the borders between pieces count.
    pub(crate) fn add(&mut self, bytes: &[u8]) {
        self.0.update(&(bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    pub(crate) fn finish(self) -> u64 {
        self.0.finalize()
    }
}

/// Checksum of bytes.
pub(crate) fn checksum(bytes: &[u8]) -> u64 {
    CRC.checksum(bytes)
}

/// A checksum as text.
pub(crate) fn hex(sum: u64) -> String {
    format!("{sum:016x}")
}

/// The object on one line, sealed, without a line end.
pub(crate) fn seal<T: Serialize>(object: &T) -> Result<Vec<u8>, serde_json::Error> {
    Ok(close(serde_json::to_vec(object)?))
}

/// The object over several lines, sealed, with a line end.
pub(crate) fn seal_pretty<T: Serialize>(object: &T) -> Result<Vec<u8>, serde_json::Error> {
    let mut text = close(serde_json::to_vec_pretty(object)?);
    text.push(b'\n');
    Ok(text)
}

/// Puts the checksum before the closing brace.
fn close(mut text: Vec<u8>) -> Vec<u8> {
    debug_assert!(text.ends_with(b"}") && text.len() > 2, "an object with fields");
    text.pop();
    let sum = checksum(&text);
    text.extend_from_slice(FIELD);
    text.extend_from_slice(hex(sum).as_bytes());
    text.extend_from_slice(END);
    text
}

/// Reads a sealed object; the error describes what is wrong with it.
pub(crate) fn unseal<T: DeserializeOwned>(text: &[u8]) -> Result<T, String> {
    let text = text.strip_suffix(b"\n").unwrap_or(text);
    let tail = FIELD.len() + DIGITS + END.len();
    if text.len() <= tail {
        return Err("it is cut off".into());
    }
    let (body, seal) = text.split_at(text.len() - tail);
    let digits = seal.strip_prefix(FIELD).and_then(|rest| rest.strip_suffix(END));
    let Some(digits) = digits else {
        return Err("it is cut off, or its end is damaged".into());
    };
    if digits != hex(checksum(body)).as_bytes() {
        return Err("its checksum does not fit".into());
    }
    let mut object = body.to_vec();
    object.push(b'}');
    serde_json::from_slice(&object).map_err(|error| format!("it cannot be understood: {error}"))
}

/// Whether a line without a line end is more than a sealed object that was cut off.
pub(crate) fn reaches_its_end(line: &[u8]) -> bool {
    let tail = FIELD.len() + DIGITS + END.len();
    line.windows(FIELD.len())
        .rposition(|window| window == FIELD)
        .is_some_and(|at| line.len() - at >= tail)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sealed_object_reads_back_and_every_flipped_bit_is_found() {
        let object = std::collections::BTreeMap::from([("a", 0.1_f64), ("b", -0.0), ("c", 1e-300)]);
        for text in [seal(&object).expect("sealed"), seal_pretty(&object).expect("sealed")] {
            let back: std::collections::BTreeMap<String, f64> = unseal(&text).expect("whole");
            for (name, value) in &object {
                assert_eq!(back[*name].to_bits(), value.to_bits());
            }
            // A line end at the end is not part of it.
            let whole = text.strip_suffix(b"\n").unwrap_or(&text).to_vec();
            for bit in 0..8 * whole.len() {
                let mut damaged = whole.clone();
                damaged[bit / 8] ^= 1 << (bit % 8);
                let read = unseal::<std::collections::BTreeMap<String, f64>>(&damaged);
                assert!(read.is_err(), "bit {bit}: {}", String::from_utf8_lossy(&damaged));
            }
            for length in 0..whole.len() {
                let cut = unseal::<std::collections::BTreeMap<String, f64>>(&whole[..length]);
                assert!(cut.is_err(), "{length}");
            }
        }
    }

    #[test]
    fn the_checksum_is_the_published_one() {
        // Check value of CRC-64/XZ in the catalogue of parametrised CRC algorithms.
        assert_eq!(checksum(b"123456789"), 0x995d_c9bb_df19_39fa);
    }
}
