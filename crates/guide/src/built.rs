//! The built book, read again: nothing from the network, and no link that leads nowhere.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// What is wrong with a book that was built in a folder, a line each: resources from the network in HTML, style sheets and pictures, and links that lead to
/// no file or no heading of the book. (Links to the web that a reader may follow are none of these.)
///
/// # Errors
///
/// Where a file cannot be read.
pub fn mistakes(folder: &Path) -> io::Result<Vec<String>> {
    let files = files(folder)?;
    let mut pages = BTreeMap::new();
    let mut found = Vec::new();
    for file in &files {
        let name = file.strip_prefix(folder).unwrap_or(file).to_path_buf();
        match file.extension().and_then(|ending| ending.to_str()) {
            Some("html") => {
                pages.insert(name, fs::read_to_string(file)?);
            }
            Some("css" | "svg") => {
                let text = fs::read_to_string(file)?;
                found.extend(loaded(&text).map(|from| format!("{}: loads {from}", name.display())));
            }
            _ => {}
        }
    }
    let ids: BTreeMap<&PathBuf, BTreeSet<&str>> =
        pages.iter().map(|(name, text)| (name, attributes(text, "id").collect())).collect();
    for (name, text) in &pages {
        found.extend(of_the_network(text).map(|from| format!("{}: loads {from}", name.display())));
        for link in attributes(text, "href").chain(attributes(text, "src")) {
            if !leads_somewhere(folder, name, link, &ids) {
                found.push(format!("{}: {link} leads nowhere", name.display()));
            }
        }
    }
    Ok(found)
}

fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(files(&path)?);
        } else {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}

fn of_the_web(link: &str) -> bool {
    link.starts_with("//") || link.contains("://")
}

/// Values of an attribute of the elements of a page.
fn attributes<'a>(text: &'a str, name: &'a str) -> impl Iterator<Item = &'a str> {
    tags(text).filter_map(move |tag| attribute(tag, name))
}

/// The inside of every tag.
fn tags(text: &str) -> impl Iterator<Item = &str> {
    text.split('<').skip(1).filter_map(|rest| rest.split('>').next())
}

fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    let begin = tag.find(&format!(" {name}=\""))? + name.len() + 3;
    tag[begin..].split('"').next()
}

/// What a page loads from the network: any `src`, and the `href` of `<link>`.
fn of_the_network(text: &str) -> impl Iterator<Item = &str> {
    tags(text)
        .flat_map(|tag| {
            let sheet = tag.starts_with("link ").then(|| attribute(tag, "href")).flatten();
            [attribute(tag, "src"), sheet]
        })
        .flatten()
        .filter(|link| of_the_web(link))
}

/// What a style sheet or a picture loads from the network: `url(..)`, `@import` and `href`.
fn loaded(text: &str) -> impl Iterator<Item = &str> {
    let quoted =
        |rest: &'_ str| -> usize { rest.find([')', '"', '\'', ';']).unwrap_or(rest.len()) };
    ["url(", "@import", "href="]
        .into_iter()
        .flat_map(move |opening| text.split(opening).skip(1))
        .map(|rest| rest.trim_start_matches([' ', '"', '\'']))
        .map(move |rest| &rest[..quoted(rest)])
        .filter(|link| of_the_web(link))
}

fn leads_somewhere(
    folder: &Path,
    page: &Path,
    link: &str,
    ids: &BTreeMap<&PathBuf, BTreeSet<&str>>,
) -> bool {
    if of_the_web(link) || link.starts_with("data:") || link.starts_with("mailto:") {
        return true;
    }
    let (path, id) = link.split_once('#').unwrap_or((link, ""));
    let target = if path.is_empty() {
        page.to_path_buf()
    } else {
        page.parent().unwrap_or(Path::new("")).join(path)
    };
    if !folder.join(&target).is_file() {
        return false;
    }
    id.is_empty() || ids.get(&target).is_none_or(|known| known.contains(id))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(files: &[(&str, &str)]) -> Vec<String> {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, text) in files {
            fs::write(folder.path().join(name), text).expect("a file");
        }
        mistakes(folder.path()).expect("readable")
    }

    #[test]
    fn a_book_that_is_whole_has_no_mistakes() {
        let page = "<link rel=\"stylesheet\" href=\"own.css\"><h2 id=\"knee\">Knee</h2>\
                    <a href=\"#knee\">up</a><a href=\"https://doi.org/10\">paper</a><img alt=\"\" src=\"p.svg\">";
        let css = "@font-face { src: url('own.woff2') }";
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\"></svg>";
        let other = "<a href=\"a.html#knee\">there</a>";
        let files = [("a.html", page), ("own.css", css), ("p.svg", svg), ("b.html", other)];
        assert_eq!(of(&files), [""; 0]);
    }

    #[test]
    fn whatever_comes_from_the_network_is_found() {
        let page =
            "<script async src=\"https://cdn.org/m.js\"></script><link href=\"//f.org/f.css\">";
        let css = "@import 'https://f.org/a.css'; b { background: url(http://f.org/b.png) }";
        let svg = "<svg><image xlink:href=\"http://f.org/c.png\"/></svg>";
        let found = of(&[("a.html", page), ("a.css", css), ("a.svg", svg)]);
        let from = ["https://f.org/a.css", "http://f.org/b.png", "http://f.org/c.png"];
        let from = from.into_iter().chain(["https://cdn.org/m.js", "//f.org/f.css"]);
        for link in from {
            assert!(found.iter().any(|line| line.ends_with(link)), "{link}: {found:?}");
        }
        assert_eq!(found.len(), 5, "{found:?}");
    }

    #[test]
    fn links_to_pages_and_headings_that_are_not_there_are_found() {
        let page = "<a href=\"b.html\">b</a><a href=\"#up\">up</a><img src=\"c.png\"><h1 id=\"down\">d</h1>";
        let found = of(&[("a.html", page)]);
        assert_eq!(
            found,
            [
                "a.html: b.html leads nowhere",
                "a.html: #up leads nowhere",
                "a.html: c.png leads nowhere"
            ]
        );
    }
}
