use proptest::prelude::*;

use super::*;

const TAU: &str = "tau_s = { distribution = \"log-uniform\", lower = 0.5, upper = 50 }\n";

#[test]
fn default_priors_are_the_documented_ones() {
    let bounds = |lower, upper| PriorSpec::LogUniform { lower, upper };
    for (material, c1, tau_s) in [
        (Material::Ps, bounds(1e-6, 1e-1), bounds(1e-2, 1.0)),
        (Material::Pa12, bounds(1e-8, 1e-2), bounds(0.5, 50.0)),
        (Material::Peek, bounds(1e-9, 1e-3), bounds(3.0, 300.0)),
    ] {
        let priors = PriorFile::of_material(material).expect("built in");
        let parameters = priors.parameters(Kinetics::ThreeStage, None).expect("complete");
        let specs: Vec<_> =
            parameters.iter().map(|parameter| parameter.prior.spec().clone()).collect();
        assert_eq!(specs, [c1, tau_s, bounds(1e-8, 3e-6)]);
        let names: Vec<_> = parameters.iter().map(|parameter| parameter.name.as_str()).collect();
        assert_eq!(names, ["c1", "tau_s", "delta_c"]);
    }
}

#[test]
fn kinetics_ask_only_for_the_priors_they_use() {
    let priors = PriorFile::parse("p.toml", TAU).expect("valid");
    assert_eq!(priors.parameters(Kinetics::Frenkel, None).expect("tau_s").len(), 1);
    let error = priors.parameters(Kinetics::ThreeStage, None).expect_err("no c1");
    assert_eq!(error.mistake, Mistake::MissingField);
    assert!(error.to_string().contains("[c1]"), "{error}");
    let with_phi = format!("{TAU}[phi]\ndistribution = \"uniform\"\nlower = 1.0\nupper = 1.35\n");
    let priors = PriorFile::parse("p.toml", &with_phi).expect("valid");
    let parameters = priors.parameters(Kinetics::Pokluda, None).expect("both");
    let names: Vec<_> = parameters.iter().map(|parameter| parameter.name.as_str()).collect();
    assert_eq!(names, ["tau_s", "phi"]);
}

#[test]
fn the_time_of_first_contact_is_optional_comes_last_and_may_be_negative() {
    let with = |t0: &str| PriorFile::parse("p.toml", &format!("t0 = {{ {t0} }}\n{TAU}"));
    for t0 in [
        "distribution = \"uniform\", lower = -5, upper = 5",
        "distribution = \"normal\", mean = 0, sd = 3",
        "distribution = \"truncated-normal\", mean = -1, sd = 3, lower = -9, upper = -0.5",
    ] {
        let parameters = with(t0).expect(t0).parameters(Kinetics::Frenkel, None).expect("both");
        let names: Vec<_> = parameters.iter().map(|p| (p.name.as_str(), p.unit.as_str())).collect();
        assert_eq!(names, [("tau_s", "s"), ("t0", "s")], "{t0}");
    }
    let error = with("distribution = \"log-uniform\", lower = -5, upper = 5").expect_err("-5");
    assert_eq!((error.mistake, error.line), (Mistake::Negative, Some(1)), "{error}");
}

#[test]
fn every_distribution_is_read() {
    for (fields, spec) in [
        ("\"uniform\", lower = 1, upper = 2", PriorSpec::Uniform { lower: 1.0, upper: 2.0 }),
        ("\"normal\", mean = 9, sd = 1", PriorSpec::Normal { mean: 9.0, sd: 1.0 }),
        (
            "\"log-normal\", median = 3, sd_log10 = 0.5",
            PriorSpec::LogNormal { median: 3.0, sd_log10: 0.5 },
        ),
        (
            "\"truncated-normal\", mean = 1, sd = 2, lower = 0, upper = 9",
            PriorSpec::TruncatedNormal { mean: 1.0, sd: 2.0, lower: 0.0, upper: 9.0 },
        ),
    ] {
        let text = format!("[tau_s]\n{}\n", format!("distribution = {fields}").replace(", ", "\n"));
        let priors = PriorFile::parse("p.toml", &text).expect(fields);
        assert_eq!(priors.get(ParameterName::TauS).map(Prior::spec), Some(&spec));
    }
}

fn refused(text: &str, kind: Mistake, line: Option<usize>, says: &str) {
    let error = PriorFile::parse("p.toml", text).expect_err(text);
    assert_eq!((error.mistake, error.line), (kind, line), "{text}\n{error}");
    assert!(error.to_string().contains(says), "{text}\n{error}");
}

#[test]
fn each_mistake_names_its_line_and_field() {
    let tau = |fields: &str| {
        let fields: String = fields.split(", ").map(|field| format!("{field}\n")).collect();
        format!("[tau_s]\ndistribution = {fields}")
    };
    for (fields, kind, line, says) in [
        ("\"loguniform\"", Mistake::UnknownName, 2, "mean \"log-uniform\"?"),
        ("\"uniform\", lower = 1", Mistake::MissingField, 1, "tau_s.upper"),
        ("\"uniform\", lower = 2, upper = 1", Mistake::Bounds, 3, "swap"),
        ("\"uniform\", lower = 2, upper = 2", Mistake::Bounds, 3, "widen"),
        ("\"log-uniform\", lower = 0, upper = 1", Mistake::OutOfRange, 3, "tau_s.lower"),
        ("\"uniform\", lower = -1, upper = 1", Mistake::Negative, 3, "tau_s.lower"),
        ("\"normal\", mean = 1, sd = 1", Mistake::Negative, 3, "log-normal"),
        ("\"normal\", mean = 1, sd = 0", Mistake::OutOfRange, 4, "tau_s.sd"),
        ("\"uniform\", lower = 1, upper = inf", Mistake::NotFinite, 4, "tau_s.upper"),
        (
            "\"uniform\", lower = 1, uper = 3, upper = 2",
            Mistake::UnknownField,
            4,
            "did you mean tau_s.upper?",
        ),
    ] {
        refused(&tau(fields), kind, Some(line), says);
    }
    for (text, kind, line, says) in [
        (String::new(), Mistake::MissingField, None, "tau_s = {"),
        ("[tau_s]\n\n".to_owned(), Mistake::MissingField, Some(1), "tau_s.distribution"),
        (
            format!("{TAU}[tau_c]\ndistribution = \"uniform\"\n"),
            Mistake::UnknownField,
            Some(2),
            "did you mean tau_s?",
        ),
        (
            format!("{TAU}[phi]\ndistribution = \"uniform\"\nlower = 1\nupper = 5\n"),
            Mistake::OutOfRange,
            Some(5),
            "phi.upper",
        ),
        ("tau_s = 3\n".to_owned(), Mistake::WrongType, Some(1), "a table [tau_s]"),
    ] {
        refused(&text, kind, line, says);
    }
}

proptest! {
    #[test]
    fn arbitrary_prior_files_never_panic(text in ".*") {
        let _ = PriorFile::parse("p.toml", &text);
    }

    #[test]
    fn any_numbers_are_a_prior_or_a_mistake(
        kind in proptest::sample::select(DISTRIBUTIONS.map(|(name, _)| name).to_vec()),
        numbers in proptest::array::uniform7(any::<f64>()),
    ) {
        let [lower, upper, mean, sd, median, sd_log10, _] = numbers;
        let mut text = format!("[tau_s]\ndistribution = \"{kind}\"\n");
        let fields: &[(&str, f64)] = match kind {
            "log-uniform" | "uniform" => &[("lower", lower), ("upper", upper)],
            "log-normal" => &[("median", median), ("sd_log10", sd_log10)],
            "normal" => &[("mean", mean), ("sd", sd)],
            _ => &[("mean", mean), ("sd", sd), ("lower", lower), ("upper", upper)],
        };
        for (name, value) in fields {
            text.push_str(&format!("{name} = {value:e}\n"));
        }
        let _ = PriorFile::parse("p.toml", &text);
    }
}

#[test]
fn priors_that_no_result_could_hold_are_refused() {
    let c1 = "distribution = \"log-uniform\", lower = 1e-8, upper = 1e-2";
    for (tau_s, field) in [
        ("distribution = \"log-uniform\", lower = 1e-300, upper = 1e300", "tau_s.lower"),
        ("distribution = \"log-uniform\", lower = 1, upper = 1e300", "tau_s.upper"),
        ("distribution = \"log-normal\", median = 10, sd_log10 = 60", "tau_s.sd_log10"),
        ("distribution = \"normal\", mean = 1e300, sd = 1", "tau_s.mean"),
        ("distribution = \"uniform\", lower = 0, upper = 1e16", "tau_s.upper"),
    ] {
        let text = format!("c1 = {{ {c1} }}\ntau_s = {{ {tau_s} }}\n");
        let error = PriorFile::parse("p.toml", &text).expect_err(tau_s);
        assert_eq!((error.mistake, error.line), (Mistake::OutOfRange, Some(2)), "{error}");
        assert!(error.to_string().contains(field), "{error}");
        assert!(error.to_string().contains("between 1e-15 and 1e15 s"), "{error}");
    }
    let t0 = "distribution = \"uniform\", lower = -1e200, upper = 5";
    let error = PriorFile::parse("p.toml", &format!("{TAU}t0 = {{ {t0} }}\n")).expect_err(t0);
    assert_eq!((error.mistake, error.line), (Mistake::OutOfRange, Some(2)), "{error}");
    let ends = "distribution = \"log-uniform\", lower = 1e-15, upper = 1e15";
    PriorFile::parse("p.toml", &format!("tau_s = {{ {ends} }}\n")).expect("the whole range");
}
