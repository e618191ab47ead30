use super::*;

fn page() -> Page {
    let mut page = Page {
        title: "<b>PS</b> & \"friends\"".to_owned(),
        kind: "Calibration".to_owned(),
        version: "1.2.3".to_owned(),
        summary: "tau_s < 1 s".to_owned(),
        advice: vec!["look at <script>alert(1)</script>".to_owned()],
        ..Page::default()
    };
    page.verdict = Some(Verdict { good: false, word: "rough:".to_owned(), why: "few".to_owned() });
    page.answer.table("rows", &["name", "value"], vec![vec!["c1".to_owned(), "2 & 3".to_owned()]]);
    page.data.fact("table", "a.csv");
    page.repeat.listings.push("calibrate --material ps".to_owned());
    page
}

#[test]
fn what_a_run_says_is_shown_as_it_is_and_never_becomes_html() {
    let html = page().html().expect("a page");
    for shown in [
        "<h1>&lt;b&gt;PS&lt;&#x2f;b&gt; &amp; &quot;friends&quot;</h1>",
        "tau_s &lt; 1 s",
        "<li>look at &lt;script&gt;alert(1)",
        "<th scope=\"row\">c1</th><td>2 &amp; 3</td>",
        "<dt>table</dt><dd>a.csv</dd>",
        "<strong>rough:</strong> few",
        "calibrate --material ps",
        "prefers-color-scheme: dark",
    ] {
        assert!(html.contains(shown), "{shown} is not in\n{html}");
    }
    assert!(!html.contains("<script>alert"), "{html}");
    assert_eq!(html.matches("<script>").count(), 1);
}

#[test]
fn sections_without_contents_are_left_out_and_headings_go_down_one_by_one() {
    let html = page().html().expect("a page");
    assert!(html.contains("id=\"data\"") && !html.contains("id=\"cite\""), "{html}");
    assert!(!html.contains("id=\"figures\""));
    let levels: Vec<u32> = html
        .match_indices("<h")
        .filter_map(|(at, _)| html[at + 2..].chars().next()?.to_digit(10))
        .collect();
    assert_eq!(levels[..3], [1, 2, 3]);
    assert!(levels.windows(2).all(|pair| pair[1] <= pair[0] + 1), "{levels:?}");
}

#[test]
fn a_page_asks_nothing_of_the_network() {
    let html = page().html().expect("a page");
    assert!(!html.contains("http://") && !html.contains("https://"), "{html}");
    assert!(html.contains("default-src 'none'"));
}

#[test]
fn all_kinds_of_run_cite_the_program_and_the_paper() {
    let cite = citation("1.2.3");
    assert!(cite.paragraphs[0].contains("version 1.2.3"));
    assert!(cite.paragraphs[1].contains("EPJ Web of Conferences 249"));
}
