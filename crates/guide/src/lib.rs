//! What makes a book of the guide's pages: formulas as MathML, links that leave the book, and the check of what was built.
//!
//! The pages are in `pages`, in plain Markdown that a forge shows too. mdBook turns them into HTML; before it does, [`page::for_the_book`] writes
//! `$..$` and `$$..$$` as MathML and takes pictures from elsewhere in the project along. [`built::mistakes`] then reads the HTML: nothing may come
//! from the network, and every link must lead to a page, a heading or a file of the book.
//!
//! `cargo run -p guide --features book` does all three, into `target/guide`.

pub mod built;
pub mod formula;
mod markdown;
pub mod page;
