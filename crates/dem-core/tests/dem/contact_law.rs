//! The contact law: continuity of its branches, and its inverse.

use dem_core::{Branch, ContactLaw, PairSpec, paper};
use proptest::prelude::*;

fn law() -> ContactLaw {
    *PairSpec::new(paper::PA12, 2f64.cbrt()).build().expect("valid").law()
}

#[test]
fn force_is_continuous_across_branches() {
    let law = law();
    let (mut seen_loading, mut seen_cohesion, mut seen_elastic) = (false, false, false);
    for i in 0..=160 {
        let p = f64::from(i) / 100.0;
        let mut before = law.respond(0.0, p).force;
        for j in 1..=30_000 {
            let x = f64::from(j) * 1e-4;
            let now = law.respond(x, p);
            // Nowhere steeper than K2max.
            assert!(
                (now.force - before).abs() <= 10.0 * 1e-4 * 1.0001,
                "{x} {p}: {before} {now:?}"
            );
            before = now.force;
            seen_loading |= now.branch == Branch::PlasticLoading;
            seen_cohesion |= now.branch == Branch::Cohesion;
            seen_elastic |= now.branch == Branch::Elastic;
        }
    }
    assert!(seen_loading && seen_cohesion && seen_elastic);
}

#[test]
fn branches_have_the_forces_of_luding() {
    let law = law();
    let width = law.plastic_overlap_max / 9.0; // delta0max K1/(K2max - K1)
    // Loading from a fresh contact: K1 delta, and delta0 behind delta by the width.
    let loading = law.respond(0.5, 0.0);
    assert_eq!((loading.branch, loading.force), (Branch::PlasticLoading, 0.5));
    assert!((loading.plastic_overlap - (0.5 - width)).abs() < 1e-15);
    // Unloading a little: elastic with K2(delta0).
    let p = loading.plastic_overlap;
    let kappa = 1.0 + 9.0 * p / law.plastic_overlap_max;
    let unloading = law.respond(0.49, p);
    assert_eq!(unloading.branch, Branch::Elastic);
    assert!((unloading.force - kappa * (0.49 - p)).abs() < 1e-15);
    // Far below delta0: -Kc delta, and delta0 lowered to where K2 (delta - delta0) agrees.
    let pulled = law.respond(0.05, p);
    assert_eq!((pulled.branch, pulled.force), (Branch::Cohesion, -0.05));
    let q = pulled.plastic_overlap;
    assert!(q < p && (law.unloading_stiffness(q) * (0.05 - q) + 0.05).abs() < 1e-15);
    // Beyond delta0max the fluid branch: K2max (delta - delta0max), not K1 delta.
    let fluid = law.respond(2.5, 1.5);
    assert!((fluid.force - 10.0 * (2.5 - law.plastic_overlap_max)).abs() < 1e-14);
    assert_eq!(fluid.plastic_overlap, law.plastic_overlap_max);
    assert_eq!(law.respond(-1e-9, 0.3).force, 0.0);
}

#[test]
fn loading_and_fluid_branch_meet() {
    let law = law();
    let meeting = law.plastic_overlap_max * (1.0 + 1.0 / 9.0);
    let (below, above) = (law.respond(meeting - 1e-12, 0.1), law.respond(meeting + 1e-12, 0.1));
    assert_eq!(below.branch, Branch::PlasticLoading);
    assert_eq!(above.branch, Branch::Elastic);
    assert!((below.force - above.force).abs() < 1e-10);
}

proptest! {
    #[test]
    fn equilibrium_and_plastic_overlap_are_inverse(p in 0.0..3.0f64) {
        let law = law();
        let x = law.equilibrium_overlap(p);
        prop_assert!((law.respond(x, p).force - law.adhesion).abs() < 1e-14);
        prop_assert!((law.equilibrium_plastic_overlap(x) - p).abs() < 1e-14 * (1.0 + p));
        // dp/dX by a central difference, away from the corner at delta0max.
        prop_assume!((p - law.plastic_overlap_max).abs() > 1e-5 && p > 1e-5);
        let h = 1e-6;
        let slope = 2.0 * h / (law.equilibrium_overlap(p + h) - law.equilibrium_overlap(p - h));
        prop_assert!((slope - law.equilibrium_factor(p)).abs() < 1e-8);
    }

    #[test]
    fn responding_twice_changes_nothing(x in 0.0..3.0f64, p in 0.0..1.58f64) {
        let law = law();
        let once = law.respond(x, p);
        let twice = law.respond(x, once.plastic_overlap);
        prop_assert!((once.force - twice.force).abs() < 1e-13);
        prop_assert!((once.plastic_overlap - twice.plastic_overlap).abs() < 1e-13);
    }
}
