use proptest::prelude::*;

use super::drawing::{Axis, BLACK, Direction, Page, Panel, Pen, Scale, TICK_SIZE, Ticks};
use super::drawing::{length, shortened};
use super::*;

/// Takes seconds without optimisation; 400 have passed as well.
const CASES: u32 = 6;
const ACROSS: Direction = Direction::Across { overhang: 10.0 };

fn ticks(scale: Scale, low: f64, high: f64, size: f32) -> Ticks {
    Axis::holding("q", "s", scale, [low, high], 0.0).ticks(size, ACROSS)
}

fn labels(ticks: &Ticks) -> Vec<&str> {
    ticks.labelled.iter().map(|(_, label)| label.as_str()).collect()
}

#[test]
fn linear_ticks_are_round_numbers_with_as_many_decimals_as_the_step() {
    let ticks = ticks(Scale::Linear, 0.0, 1.26, 200.0);
    assert_eq!(labels(&ticks), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0", "1.2"]);
    let places: Vec<f64> = ticks.labelled.iter().map(|(c, _)| *c).collect();
    assert_eq!(places, [0.0, 0.2, 0.4, 0.6, 0.8, 1.0, 1.2].map(|v: f64| (v * 5.0).round() * 0.2));
}

#[test]
fn small_times_get_an_si_prefix() {
    let ticks = ticks(Scale::Linear, 0.0, 0.03, 200.0);
    assert_eq!(labels(&ticks), ["0", "5", "10", "15", "20", "25", "30"]);
    assert_eq!(ticks.unit, " (ms)");
}

#[test]
fn large_numbers_without_a_prefix_get_a_power() {
    let axis = Axis::holding("n", "", Scale::Linear, [0.0, 3e30], 0.0);
    let ticks = axis.ticks(200.0, ACROSS);
    assert_eq!(ticks.unit, " (10^{30})");
    assert_eq!(labels(&ticks), ["0.0", "0.5", "1.0", "1.5", "2.0", "2.5", "3.0"]);
}

#[test]
fn close_labels_leave_what_they_share_to_the_title() {
    let ticks = ticks(Scale::Linear, 1.000_000_1, 1.000_000_2, 200.0);
    assert_eq!(ticks.name, "q − 1.0000001");
    assert_eq!(ticks.unit, " (10^{−7} s)");
    assert_eq!(labels(&ticks), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
}

#[test]
fn decades_are_labelled_as_powers_of_ten() {
    let axis = ticks(Scale::Log, 1e-3, 1e2, 200.0);
    assert_eq!(labels(&axis), ["10^{−3}", "10^{−2}", "10^{−1}", "10^{0}", "10^{1}", "10^{2}"]);
    let exponents = ticks(Scale::Exponent, -3.0, 2.0, 200.0);
    assert_eq!(exponents.labelled, axis.labelled);
    let wide = ticks(Scale::Log, 1e-30, 1e30, 200.0);
    assert!((3..=9).contains(&wide.labelled.len()), "{:?}", labels(&wide));
}

#[test]
fn a_range_below_two_decades_is_labelled_with_numbers() {
    let ticks = ticks(Scale::Log, 0.15, 9.0, 200.0);
    assert_eq!(labels(&ticks), ["0.2", "0.3", "0.5", "1", "2", "3", "5"]);
}

#[test]
fn counts_have_no_fractions() {
    let ticks = Axis::holding("n", "", Scale::Count, [0.0, 2.0], 0.0).ticks(200.0, ACROSS);
    assert_eq!(labels(&ticks), ["0", "1", "2"]);
}

#[test]
fn scripts_are_shorter_than_text_and_markup_takes_no_room() {
    assert_eq!(length("a_{}b", 7.0), length("ab", 7.0));
    assert!(length("C_{1}", 7.0) < length("C1", 7.0));
    let raised = length("10", 10.0) + length("−3", 7.2);
    assert!((length("10^{−3}", 10.0) - raised).abs() < 1e-4);
    assert!(length("file_name", 7.0) > length("filename", 7.0));
}

#[test]
fn a_shortened_text_fits_and_never_shows_markup() {
    for room in 1..80 {
        let short = shortened("k_{max} of 10^{−3}", 7.0, room as f32);
        assert!(length(&short, 7.0) <= room as f32);
        assert_eq!(short.matches('{').count(), short.matches('}').count(), "{short}");
    }
}

/// A figure on its page.
fn drawn(figure: &dyn Figure, width: Width) -> Page {
    let page = Page::new(width);
    figure.draw(&page).expect("the columns match");
    page
}

/// Every figure at both widths, with few and many observations and with long names.
fn every_page() -> Vec<(String, Page)> {
    let mut pages = Vec::new();
    for (n, end_s, long_names) in [
        (0, 1.0, false),
        (1, 1.0, false),
        (2, 3e-12, true),
        (5, 0.13, true),
        (50, 6.1, false),
        (50, 8.2e7, true),
    ] {
        for (name, figure) in synthetic::figures(n, end_s, long_names) {
            for width in [Width::Column, Width::Full] {
                let page = drawn(figure.as_ref(), width);
                pages.push((format!("{name} with {n} observations, {width:?}"), page));
            }
        }
    }
    pages
}

/// Panics, naming both, if two texts touch or one leaves the canvas.
fn assert_texts_are_apart(name: &str, page: &Page) {
    let canvas = page.canvas();
    let (width, height) = canvas.size_in_points();
    for (i, one) in canvas.texts.iter().enumerate() {
        let b = one.bounds;
        assert!(
            b.left() >= 0.0 && b.top() >= 0.0 && b.right() <= width && b.bottom() <= height,
            "{name}: `{}` at {b:?} leaves the canvas of {} x {}",
            one.text,
            width,
            height
        );
        for other in &canvas.texts[..i] {
            let o = other.bounds;
            let apart = b.left() > o.right()
                || o.left() > b.right()
                || b.top() > o.bottom()
                || o.top() > b.bottom();
            assert!(apart, "{name}: `{}` at {b:?} and `{}` at {o:?} overlap", one.text, other.text);
        }
    }
}

#[test]
fn no_text_overlaps_another_or_leaves_the_canvas() {
    for (name, page) in every_page() {
        assert!(page.canvas().texts.len() >= 3, "{name} has lost its texts");
        assert_texts_are_apart(&name, &page);
    }
}

#[test]
fn texts_are_of_a_size_that_can_be_read_in_print() {
    const { assert!(TICK_SIZE >= 7.0) };
}

#[test]
fn the_same_figure_gives_the_same_bytes() {
    let render = || {
        synthetic::figures(20, 6.1, false)
            .into_iter()
            .map(|(_, figure)| figure.render(Width::Column).expect("the columns match"))
            .collect::<Vec<_>>()
    };
    assert_eq!(render(), render());
}

/// The texts of a figure in the order of drawing.
fn written_on(figure: &dyn Figure, width: Width) -> Vec<String> {
    drawn(figure, width).canvas().texts.iter().map(|t| t.text.clone()).collect()
}

fn corner(draws: Vec<f64>, paper: f64, count: usize) -> CornerFigure {
    let parameter = CornerParameter {
        symbol: "q".to_owned(),
        draws,
        paper: Some(paper),
        ..CornerParameter::default()
    };
    CornerFigure { parameters: vec![parameter; count], ..CornerFigure::default() }
}

#[test]
fn a_paper_value_outside_the_range_is_named_at_the_edge() {
    let draws: Vec<f64> = (0..=100).map(|i| 4.0 + 0.001 * f64::from(i)).collect();
    // With the word or, where that is too long, without.
    let named = |paper: f64| {
        let value = format!("{paper:.2}");
        let texts = written_on(&corner(draws.clone(), paper, 1), Width::Full);
        texts.iter().any(|text| *text == value || *text == format!("paper {value}"))
    };
    assert!(named(3.0) && named(9.0) && !named(4.05));
}

#[test]
fn a_marginal_is_headed_by_its_median_and_interval_with_digits_that_tell_them_apart() {
    let draws: Vec<f64> = (0..=1000).map(|i| 4.0 + 1e-5 * f64::from(i)).collect();
    let texts = written_on(&corner(draws, 4.0, 2), Width::Full);
    assert_eq!(texts.iter().filter(|t| *t == "q = 4.005").count(), 2, "{texts:?}");
    assert_eq!(texts.iter().filter(|t| *t == "4.000 … 4.010").count(), 2, "{texts:?}");
}

#[test]
fn every_axis_of_five_parameters_in_a_column_has_two_labels_at_least() {
    let draws: Vec<f64> = (0..=100).map(|i| 1234.0 + 3.0 * f64::from(i)).collect();
    let texts = written_on(&corner(draws, 1300.0, 5), Width::Column);
    let labels = texts.iter().filter(|t| t.chars().all(|c| c.is_ascii_digit())).count();
    // Four vertical axes and five horizontal ones.
    assert!(labels >= 18, "{texts:?}");
}

#[test]
fn a_curve_is_cut_at_the_edge_where_it_leaves_the_panel() {
    let page = Page::new(Width::Column);
    let axis = Axis::holding("q", "", Scale::Linear, [0.0, 1.0], 0.0);
    let panel = Panel::new(&page, (10.0, 20.0), (100.0, 50.0), &axis, &axis);
    let pen = Pen::solid(BLACK, 1.0);
    // From the middle far up and to the right: it leaves through the upper edge at x = 3/4.
    panel.line(&[0.5, 0.5 + 1e8], &[0.5, 0.5 + 2e8], pen).expect("nothing to refuse");
    assert!(page.canvas().svg().contains("M6000 4500L8500 2000\""), "{}", page.canvas().svg());
}

/// Checks a document of one element per line, as the writer makes them, against the rules of XML.
fn assert_well_formed(svg: &str) {
    let lines: Vec<&str> = svg.lines().collect();
    assert!(lines[0].starts_with("<svg ") && lines[0].ends_with("\">"), "{}", lines[0]);
    assert_eq!(lines[lines.len() - 1], "</svg>");
    for line in &lines[1..lines.len() - 1] {
        let inner = line
            .strip_prefix('<')
            .and_then(|l| l.strip_suffix("/>"))
            .expect("one element per line");
        let (element, mut attributes) = inner.split_once(' ').expect("an element with attributes");
        assert!(["path", "rect"].contains(&element), "{line}");
        let mut seen = Vec::new();
        while !attributes.trim().is_empty() {
            let (key, rest) = attributes.trim_start().split_once("=\"").expect("key=\"");
            let (value, rest) = rest.split_once('"').expect("a closing quote");
            assert!(
                !value.contains(['<', '>']) && !value.contains("NaN") && !value.contains("inf"),
                "{line}"
            );
            for entity in value.split('&').skip(1) {
                assert!(
                    ["amp;", "lt;", "gt;", "quot;"].iter().any(|e| entity.starts_with(e)),
                    "{line}"
                );
            }
            assert!(!seen.contains(&key), "{key} twice in {line}");
            seen.push(key);
            attributes = rest;
        }
    }
}

#[test]
fn each_quantity_of_the_ranks_is_named_with_its_p_value() {
    let quantity = |name: &str, p_value| RankedQuantity {
        name: name.to_owned(),
        difference: vec![0.01, -0.02, 0.0],
        p_value,
    };
    let figure = RanksFigure {
        level: vec![0.25, 0.5, 0.75],
        quantities: vec![quantity("sigma", 0.034), quantity("c1", f64::NAN)],
        ..RanksFigure::default()
    };
    let texts = written_on(&figure, Width::Column);
    assert!(texts.iter().any(|t| t == "sigma (p = 0.03)"), "{texts:?}");
    assert!(texts.iter().any(|t| t == "c1"), "{texts:?}");
    // Both directions from zero, to the same height.
    assert!(texts.iter().any(|t| t == "−0.02") && texts.iter().any(|t| t == "0.02"), "{texts:?}");
}

#[test]
fn a_bed_is_headed_by_its_title_above_its_colour_scale() {
    let page = Page::new(Width::Column);
    synthetic::bed().draw(&page).expect("the columns match");
    assert_texts_are_apart("bed", &page);
    let first = page.canvas().texts.first().map(|t| t.text.clone());
    assert_eq!(first.as_deref(), Some("27 particles"));
}

#[test]
fn svg_is_well_formed_whatever_the_names() {
    let mut figure =
        WorkPrecisionFigure { title: "<&\"'> \u{1} ]]> 漢".to_owned(), ..Default::default() };
    figure.cost_name = "a < b & c".to_owned();
    assert_well_formed(&figure.render(Width::Full).expect("nothing to mismatch").svg);
    for (_, figure) in synthetic::figures(5, 6.1, true) {
        assert_well_formed(&figure.render(Width::Column).expect("the columns match").svg);
    }
}

#[test]
fn a_png_has_the_size_of_the_column_at_300_dots_per_inch() {
    let picture = RegimeMapFigure::default().render(Width::Column).expect("nothing to mismatch");
    let reader =
        png::Decoder::new(std::io::Cursor::new(&picture.png)).read_info().expect("a PNG file");
    let info = reader.info();
    assert_eq!(info.width, 1004);
    assert_eq!(info.pixel_dims.map(|d| d.xppu), Some(11811));
    assert!(picture.svg.contains("width=\"85.00mm\""));
}

#[test]
fn the_error_names_the_column_of_the_wrong_length() {
    let figure = FitFigure { control: vec![1.0, 2.0], value: vec![0.1], ..Default::default() };
    let message = figure.render(Width::Column).expect_err("one value for two times").to_string();
    assert_eq!(
        message,
        "figure fit: `value` has 1 values where 2 are needed; give one per control value"
    );
    let corner =
        CornerFigure { parameters: vec![CornerParameter::default(); 6], ..Default::default() };
    assert!(matches!(
        corner.render(Width::Full),
        Err(PlotError::TooMany { found: 6, most: 5, .. })
    ));
}

#[test]
fn contours_enclose_the_cells_above_the_level_and_holes_wind_the_other_way() {
    // A ring of ones around an empty middle.
    let mut mass = vec![0.0; 49];
    for y in 1..6 {
        for x in 1..6 {
            mass[y * 7 + x] = if (2..5).contains(&x) && (2..5).contains(&y) { 0.0 } else { 1.0 };
        }
    }
    let area = |outline: &[(f64, f64)]| -> f64 {
        let next = outline.iter().cycle().skip(1);
        outline.iter().zip(next).map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum::<f64>() / 2.0
    };
    let mut areas: Vec<f64> = density::contours(&mass, 7, 0.5).iter().map(|o| area(o)).collect();
    areas.sort_by(f64::total_cmp);
    // A square of side 5 with its corners cut, and a hole of side 3 with its corners cut.
    assert_eq!(areas, [-(9.0 - 0.5), 25.0 - 0.5]);
}

#[test]
fn a_marginal_integrates_to_one_and_stays_flat_up_to_the_bounds_of_the_prior() {
    let bins = density::Bins { low: -0.1, high: 1.1, count: 120, support: (0.0, 1.0) };
    let draws: Vec<f64> = (0..10_000).map(|i| (f64::from(i) + 0.5) / 10_000.0).collect();
    let density = density::marginal(&bins, &draws, |_| 1.0, 0.05);
    let mass: f64 = density.iter().map(|d| d * bins.width()).sum();
    assert!((mass - 1.0).abs() < 1e-9, "{mass}");
    for (i, d) in density.iter().enumerate() {
        let inside = (0.0..1.0).contains(&bins.centre(i));
        assert!((d - f64::from(u8::from(inside))).abs() < 0.02, "{d} at {}", bins.centre(i));
    }
}

#[test]
fn a_level_holds_its_share_of_a_normal_density() {
    // Half of a normal density lies above 0.7966 of its height (|z| < 0.6745).
    let mass: Vec<f64> =
        (-4000..=4000).map(|i| (-0.5 * (f64::from(i) / 1000.0).powi(2)).exp()).collect();
    assert!((density::level_holding(&mass, 0.5) - 0.796_6).abs() < 1e-3);
}

fn any_number() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => -10.0..10.0_f64,
        2 => (-300.0..300.0_f64).prop_map(|e| 10_f64.powf(e)),
        1 => (-300.0..300.0_f64).prop_map(|e| -(10_f64.powf(e))),
        1 => prop_oneof![Just(0.0), Just(f64::NAN), Just(f64::INFINITY), Just(f64::MIN), Just(f64::MAX), Just(5e-324)],
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10 * CASES, ..ProptestConfig::default() })]

    #[test]
    fn ticks_lie_within_the_axis_and_apart(a in any_number(), b in any_number(), size in 20.0..450.0_f32) {
        for scale in [Scale::Linear, Scale::Log, Scale::Exponent, Scale::Count] {
            for direction in [ACROSS, Direction::Up] {
                let axis = Axis::holding("q", "m", scale, [a, b], 0.03);
                let ticks = axis.ticks(size, direction);
                prop_assert!(axis.low < axis.high);
                let slack = (axis.high - axis.low) * 1e-6;
                let along = |c: f64| ((c - axis.low) / (axis.high - axis.low)) as f32 * size;
                for pair in ticks.labelled.windows(2) {
                    prop_assert!(pair[0].1 != pair[1].1, "{:?} {:?}", (a, b, scale), ticks);
                    let room = match direction {
                        Direction::Up => TICK_SIZE,
                        Direction::Across { .. } => pair.iter().map(|(_, l)| length(l, TICK_SIZE) / 2.0).sum(),
                    };
                    prop_assert!(along(pair[1].0) - along(pair[0].0) >= room, "{:?} {:?}", (a, b, scale), ticks);
                }
                for (c, label) in &ticks.labelled {
                    prop_assert!((axis.low - slack..=axis.high + slack).contains(c), "{label} at {c} in {axis:?}");
                }
            }
        }
    }
}

/// A corner of two parameters with the same prior, one of them perhaps given by its logarithm.
fn corner_of_two(xs: &[f64], ys: &[f64], map: f64, log10: bool) -> CornerFigure {
    let parameter = CornerParameter {
        log10,
        draws: xs.to_vec(),
        quantiles: xs.first_chunk().copied(),
        prior: xs.iter().copied().zip(ys.iter().copied()).collect(),
        paper: ys.first().copied(),
        map: Some(map),
        ..Default::default()
    };
    let other = CornerParameter { draws: ys.to_vec(), log10: false, ..parameter.clone() };
    CornerFigure { parameters: vec![parameter, other], weights: ys.to_vec(), ..Default::default() }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: CASES, ..ProptestConfig::default() })]

    #[test]
    fn no_numbers_make_a_figure_panic_or_its_texts_overlap(
        xs in prop::collection::vec(any_number(), 0..8),
        shift in any_number(),
        log in any::<bool>(),
    ) {
        let ys: Vec<f64> = xs.iter().rev().map(|x| x * shift).collect();
        let band = Band { lower: ys.clone(), upper: xs.clone() };
        let mut sorted = xs.clone();
        sorted.sort_by(f64::total_cmp);
        let recursion = RecursionParameter {
            median: ys.clone(), interval50: band.clone(), interval90: band.clone(), paper: Some(shift), log10: log,
            ..Default::default()
        };
        let stage = |i: usize| ConvergenceStage {
            simulations: sorted[i], beta: ys[i], ess: xs[i], log_evidence: ys[i], log_evidence_error: xs[i],
            components: xs[i], k_hat: ys[i],
        };
        let curve = NamedCurve { name: "m".into(), role: Role::Series(9), curve: ys.clone(), at_data: xs.clone() };
        let series = WorkPrecisionSeries {
            name: "m".into(), role: Role::Map, cost: xs.clone(), error: ys.clone(), band: band.clone(),
        };
        let work_precision =
            WorkPrecisionFigure { series: vec![series], guide_slope: Some(shift), ..Default::default() };
        let axes = Axes { from_zero: shift > 0.0, log_control: log, ..Axes::default() };
        let figures: Vec<Box<dyn Figure>> = vec![
            Box::new(FitFigure {
                control: xs.clone(), value: ys.clone(), grid: sorted.clone(), mean: ys.clone(),
                band50: band.clone(), band90: band.clone(), predictive90: band.clone(), map: xs.clone(),
                paper: ys.clone(), frenkel: xs.clone(), knee: Some(Knee { time_s: shift, ratio: shift, lower: 0.0, upper: shift }),
                paper_knee: Some(shift), title: "t".into(),
                axes: axes.clone(),
            }),
            Box::new(corner_of_two(&xs, &ys, shift, log)),
            Box::new(RecursionFigure {
                control: sorted.clone(), log_control: log, parameters: vec![recursion], ess: xs.clone(), ..Default::default()
            }),
            Box::new(ConvergenceFigure {
                stages: (0..xs.len()).map(stage).collect(), k_hat_limit: shift, ess_target: Some(shift), k_hat_of_result: Some(shift), title: String::new(),
            }),
            Box::new(ResidualsFigure {
                control: sorted.clone(), residual: ys.clone(), sigma: shift, title: String::new(),
                axes: axes.clone(),
            }),
            Box::new(RegimeMapFigure {
                grid_s: sorted.clone(), a0: shift, a1: ys.clone(), a2: xs.clone(), p1: Some((shift, 0.1)),
                p2: Some((0.1, shift)), final_ratio: Some(shift), data_time_s: xs.clone(), data_ratio: ys.clone(), title: String::new(),
            }),
            Box::new(CompareFigure {
                control: sorted.clone(), value: ys.clone(), grid: sorted.clone(), curves: vec![curve],
                axes, title: String::new(),
            }),
            Box::new(TogetherFigure { curves: vec![TogetherCurve {
                name: "m".into(), control: sorted.clone(), value: ys.clone(), grid: sorted.clone(), mean: xs.clone(), band90: band.clone(),
            }; 2], ..Default::default() }),
            Box::new(WorkPrecisionGrid {
                rows: vec![vec![work_precision.clone(); 2], vec![work_precision.clone()], vec![]],
                title: String::new(),
            }),
            Box::new(work_precision),
            Box::new(SeriesFigure {
                time_s: sorted.clone(), relative_density: xs.clone(), coordination: ys.clone(),
                mean_contact_ratio: ys.clone(), contact_ratio_10: xs.clone(), contact_ratio_90: ys.clone(),
                heated_from_s: Some(shift), pairs_end_s: xs.first().copied(), title: String::new(),
            }),
            Box::new(CurvesFigure {
                curves: vec![MarkedCurve { name: "m".into(), role: Role::Map, x: sorted.clone(), y: ys.clone(), mark: Some((shift, shift)) }; 2],
                x_name: "x".into(), y_name: "y".into(), mark_name: "end".into(), title: String::new(),
            }),
            Box::new(DensificationFigure {
                time_s: sorted.clone(), median: ys.clone(), band50: band.clone(), band90: band.clone(),
                pairs_end_at: Some(shift), target: shift, time_to_target_s: Some(shift),
                interval_s: [xs.first().copied(), None], ..Default::default()
            }),
            Box::new(RanksFigure {
                level: sorted.clone(), band95: band, title: String::new(),
                quantities: vec![RankedQuantity { name: "q".into(), difference: ys, p_value: shift }; 4],
            }),
        ];
        for (i, figure) in figures.iter().enumerate() {
            let page = drawn(figure.as_ref(), Width::Column);
            assert_texts_are_apart(&format!("figure {i}"), &page);
            assert_well_formed(&page.canvas().svg());
        }
    }
}
