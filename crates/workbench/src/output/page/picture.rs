//! Figures within a page: no request leaves it for them, and all of them together are small enough to be sent.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use figures::Picture as Rendered;
use serde::{Serialize, Serializer};

/// Largest SVG that is shown as such; a larger one is shown as its PNG where that is smaller \[bytes\].
const LARGEST_SVG: usize = 400_000;
/// Most of all figures together \[bytes\].
const MOST: usize = 2_500_000;
/// Pixels of CSS in a millimetre.
const PER_MM: f64 = 96.0 / 25.4;
/// Dots per CSS pixel of the pictures of this program, which have 300 per inch.
const DOTS: f64 = 300.0 / 96.0;

/// A figure that was drawn, by the name of its files. One of the two may be empty, where it is not drawn so.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Drawn {
    /// Name of its files, without the ending.
    pub name: String,
    /// Its bytes.
    pub picture: Rendered,
}

impl Drawn {
    /// A picture that is drawn as PNG alone.
    pub(crate) fn of_png(name: &str, png: Vec<u8>) -> Self {
        Self { name: name.to_owned(), picture: Rendered { png, svg: String::new() } }
    }
}

/// A figure in a page.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Picture {
    /// Name of the figure.
    pub name: String,
    /// What it shows, in words.
    pub caption: String,
    /// Width in pixels of CSS.
    pub width: u32,
    /// Height in pixels of CSS.
    pub height: u32,
    /// The figure as a `data:` address, in which nothing has a meaning in HTML.
    #[serde(serialize_with = "as_it_is")]
    pub source: String,
}

/// Not escaped once more, which would take longer than all else of a page.
fn as_it_is<S: Serializer>(source: &str, serializer: S) -> Result<S::Ok, S::Error> {
    minijinja::Value::from_safe_string(source.to_owned()).serialize(serializer)
}

/// Figures in their order while there is room, and the names of the others.
pub(super) fn fitted(
    drawn: &[Drawn],
    caption: impl Fn(&str) -> String,
) -> (Vec<Picture>, Vec<String>) {
    let (mut shown, mut left_out, mut taken) = (Vec::new(), Vec::new(), 0);
    for one in drawn {
        let picture = picture(one, caption(&one.name));
        match picture.filter(|picture| taken + picture.source.len() <= MOST) {
            Some(picture) => {
                taken += picture.source.len();
                shown.push(picture);
            }
            None => left_out.push(one.name.clone()),
        }
    }
    (shown, left_out)
}

/// A figure as SVG, or as PNG where that is smaller by far; none where its size is not known.
fn picture(Drawn { name, picture }: &Drawn, caption: String) -> Option<Picture> {
    let svg = (!picture.svg.is_empty()).then_some(&picture.svg);
    let as_svg = svg.filter(|svg| {
        svg.len() <= LARGEST_SVG || picture.png.is_empty() || svg.len() < picture.png.len()
    });
    let (source, [width, height]) = match as_svg {
        Some(svg) => (svg_address(svg), svg_size(svg)?),
        None => {
            let address = format!("data:image/png;base64,{}", STANDARD.encode(&picture.png));
            (address, png_size(&picture.png)?)
        }
    };
    let pixels = |length: f64| length.round().clamp(1.0, 1e5) as u32;
    let (width, height) = (pixels(width), pixels(height));
    Some(Picture { name: name.clone(), caption, width, height, source })
}

/// An SVG document as an address. What has a meaning in an address or in HTML is written by its number; path data, which is
/// most of a figure, stays as it is, so that it grows by a few percent and not by a third as with base64.
fn svg_address(svg: &str) -> String {
    let mut address = String::with_capacity(svg.len() + svg.len() / 8);
    address.push_str("data:image/svg+xml,");
    // A document may have either quote.
    let one_kind = !svg.contains('\'');
    for byte in svg.bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b' ' | b'-' | b'.' | b'=' | b'/' | b':' => {
                address.push(char::from(byte));
            }
            b'"' if one_kind => address.push_str("%27"),
            _ => {
                const DIGITS: &[u8; 16] = b"0123456789ABCDEF";
                let digit = |part: u8| char::from(DIGITS[usize::from(part & 15)]);
                address.extend(['%', digit(byte >> 4), digit(byte)]);
            }
        }
    }
    address
}

/// Width and height of an SVG document in millimetres, in pixels of CSS.
fn svg_size(svg: &str) -> Option<[f64; 2]> {
    let head = &svg[..svg.find('>')?];
    let length = |name: &str| {
        let (_, rest) = head.split_once(&format!(" {name}=\""))?;
        let (value, _) = rest.split_once("mm\"")?;
        value.parse::<f64>().ok().map(|mm| mm * PER_MM)
    };
    Some([length("width")?, length("height")?])
}

/// Width and height of a PNG file, in pixels of CSS.
fn png_size(png: &[u8]) -> Option<[f64; 2]> {
    let number = |at: usize| {
        let bytes: [u8; 4] = png.get(at..at + 4)?.try_into().ok()?;
        Some(f64::from(u32::from_be_bytes(bytes)) / DOTS)
    };
    png.starts_with(b"\x89PNG").then_some([number(16)?, number(20)?])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(name: &str, svg: &str, png: Vec<u8>) -> Drawn {
        Drawn { name: name.to_owned(), picture: Rendered { png, svg: svg.to_owned() } }
    }

    const HEAD: &str =
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"25.40mm\" height=\"50.80mm\"";

    fn png(width: u32, height: u32, bytes: usize) -> Vec<u8> {
        let mut png = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR".to_vec();
        png.extend(width.to_be_bytes());
        png.extend(height.to_be_bytes());
        png.resize(bytes.max(png.len()), 0);
        png
    }

    /// RFC 3986: an address decodes to what was put into it.
    #[test]
    fn an_svg_is_an_address_that_decodes_to_it_and_has_nothing_of_html() {
        let svg = format!("{HEAD}><text>\"a\" & 'b' µ %3C #\n</text></svg>");
        let address = svg_address(&svg);
        assert!(!address.contains(['<', '>', '"', '\'', '&', '#', '\n']), "{address}");
        let mut bytes = Vec::new();
        let mut rest = address.strip_prefix("data:image/svg+xml,").expect("the start").bytes();
        while let Some(byte) = rest.next() {
            bytes.push(match byte {
                b'%' => {
                    let digits = [rest.next().expect("a digit"), rest.next().expect("a digit")];
                    let digits = std::str::from_utf8(&digits).expect("ASCII");
                    u8::from_str_radix(digits, 16).expect("a number")
                }
                byte => byte,
            });
        }
        assert_eq!(String::from_utf8(bytes).expect("UTF-8"), svg);
    }

    #[test]
    fn a_figure_has_its_printed_size_and_a_large_svg_is_shown_as_png() {
        let caption = |name: &str| format!("the {name}");
        let small = drawn("small", &format!("{HEAD}></svg>"), png(300, 600, 40));
        let large = format!("{HEAD}>{}</svg>", " ".repeat(LARGEST_SVG));
        let large = drawn("large", &large, png(300, 600, 40));
        let (shown, left_out) = fitted(&[small, large], caption);
        assert!(left_out.is_empty());
        for one in &shown {
            assert_eq!((one.width, one.height), (96, 192), "an inch by two");
        }
        assert!(shown[0].source.starts_with("data:image/svg+xml,"));
        assert!(shown[1].source.starts_with("data:image/png;base64,iVBORw0KGgo"));
        assert_eq!(shown[1].caption, "the large");
    }

    #[test]
    fn figures_beyond_the_room_of_a_page_are_named_in_place_of_shown() {
        let one = |name: &str| drawn(name, "", png(300, 300, 1_000_000));
        let (shown, left_out) = fitted(&[one("a"), one("b"), one("c")], str::to_owned);
        assert_eq!(shown.len(), 1, "a million bytes are 1.33 million characters");
        assert_eq!(left_out, ["b", "c"]);
    }

    #[test]
    fn what_is_no_picture_is_left_out() {
        let broken = [drawn("a", "<svg", Vec::new()), drawn("b", "", b"\x89PNG".to_vec())];
        let (shown, left_out) = fitted(&broken, str::to_owned);
        assert_eq!((shown.len(), left_out.len()), (0, 2));
    }
}
