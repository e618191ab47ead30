//! Builds the guide: `cargo run -p guide --features book`, into `target/guide`.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::rc::Rc;

use guide::{built, page};
use mdbook_driver::MDBook;
use mdbook_driver::book::{Book, BookItem};
use mdbook_driver::errors::{Error, Result};
use mdbook_preprocessor::{Preprocessor, PreprocessorContext};

/// The pages, from the top of the project.
const PAGES: &str = "crates/guide/pages";

fn main() -> ExitCode {
    match build() {
        Ok(index) => {
            let _ = writeln!(std::io::stdout(), "{}", index.display());
            ExitCode::SUCCESS
        }
        Err(error) => {
            let _ = writeln!(std::io::stderr(), "error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Builds the book and reads it again; its first page.
fn build() -> Result<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR"));
    let project = own.join("../..").canonicalize()?;
    let pictures = Rc::new(RefCell::new(BTreeSet::new()));
    let mut book = MDBook::load(own)?;
    book.with_preprocessor(Pages { pictures: Rc::clone(&pictures) });
    let folder = book.build_dir_for("html");
    if folder.exists() {
        fs::remove_dir_all(&folder)?;
    }
    book.build()?;
    fs::create_dir_all(folder.join("pictures"))?;
    for picture in pictures.borrow().iter() {
        let own = folder.join("pictures").join(page::picture_name(picture));
        fs::copy(project.join(picture), own)
            .map_err(|error| Error::msg(format!("{}: {error}", picture.display())))?;
    }
    let mistakes = built::mistakes(&folder)?;
    if !mistakes.is_empty() {
        return Err(Error::msg(mistakes.join("\n")));
    }
    Ok(folder.canonicalize()?.join("index.html"))
}

/// Formulas, pictures and links of every page.
struct Pages {
    pictures: Rc<RefCell<BTreeSet<PathBuf>>>,
}

impl Preprocessor for Pages {
    fn name(&self) -> &str {
        "pages"
    }

    fn run(&self, _: &PreprocessorContext, mut book: Book) -> Result<Book> {
        let mut wrong = Vec::new();
        book.for_each_mut(|item| {
            let BookItem::Chapter(chapter) = item else { return };
            match page::for_the_book(&chapter.content, Path::new(PAGES)) {
                Ok(page) => {
                    chapter.content = page.text;
                    self.pictures.borrow_mut().extend(page.pictures);
                }
                Err(error) => wrong.push(format!("{}: {error}", chapter.name)),
            }
        });
        if wrong.is_empty() { Ok(book) } else { Err(Error::msg(wrong.join("\n"))) }
    }
}
