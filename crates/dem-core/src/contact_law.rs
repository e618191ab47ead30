//! The contact law: elasto-plastic, adhesive, dissipative (eq. 1; S. Luding, Granular Matter 10
//! (2008) 235).
//!
//! With the repulsion positive and `v_n = -d delta/dt`, `f_n = f_ep - fa - gamma_n v_n`, where the
//! elasto-plastic force has three branches. With `f_el = K2(delta0) (delta - delta0)`:
//!
//! - **plastic loading**, `f_el > K1 delta` (only where `delta - delta0 > delta0max K1/(K2max - K1)`):
//!   `f_ep = K1 delta`, and delta0 follows at that distance behind delta, until it reaches delta0max;
//!   beyond that the **fluid branch** `f_ep = K2max (delta - delta0)` holds with delta0 left as it is;
//! - **cohesion**, `f_el < -Kc delta`: `f_ep = -Kc delta`, and delta0 is lowered until
//!   `K2(delta0) (delta - delta0) = -Kc delta`. (Eq. 1 prints `+Kc delta`; the sign is Luding's.)
//! - otherwise **elastic**, `f_ep = f_el`.
//!
//! `K2(delta0) = K1 + (K2max - K1) delta0/delta0max`, at most K2max, and `delta0max = phi^2 R`.
//!
//! The law is written in lengths of R and forces of `K1 R`: `x = delta/R`, `p = delta0/R`,
//! `kappa = K2/K1`. It knows neither scenes nor solvers.

/// The branches of the law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Branch {
    /// No overlap, no force.
    Apart,
    /// `f_ep = K1 delta`, the plastic overlap rises with the overlap.
    PlasticLoading,
    /// `f_ep = K2(delta0) (delta - delta0)`.
    Elastic,
    /// `f_ep = -Kc delta`, the plastic overlap falls with the overlap.
    Cohesion,
}

/// Force and state of a contact by the law, in units of `K1 R` and R.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Elasto-plastic force `f_ep / (K1 R)`.
    pub force: f64,
    /// Plastic overlap `delta0 / R`, as the branch leaves it.
    pub plastic_overlap: f64,
    /// The branch.
    pub branch: Branch,
}

/// The parameters of the law, dimensionless.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ContactLaw {
    /// Adhesive force `alpha = fa / (K1 R)`.
    pub adhesion: f64,
    /// `K2max / K1`, above 1.
    pub k2_max: f64,
    /// `Kc / K1`, not negative.
    pub kc: f64,
    /// `delta0max / R = phi^2`, positive.
    pub plastic_overlap_max: f64,
}

impl ContactLaw {
    /// Slope `dkappa/dp = (K2max/K1 - 1) R/delta0max` below the fluid branch.
    #[must_use]
    #[inline]
    pub fn stiffening(&self) -> f64 {
        (self.k2_max - 1.0) / self.plastic_overlap_max
    }

    /// Unloading stiffness `kappa(p) = K2(delta0)/K1`.
    #[must_use]
    #[inline]
    pub fn unloading_stiffness(&self, plastic_overlap: f64) -> f64 {
        (1.0 + self.stiffening() * plastic_overlap).min(self.k2_max)
    }

    /// `f_ep` and the plastic overlap, for overlap `x` and plastic overlap `p` (eq. 1).
    #[must_use]
    #[inline]
    pub fn respond(&self, overlap: f64, plastic_overlap: f64) -> Response {
        let (x, p) = (overlap, plastic_overlap);
        if x < 0.0 {
            return Response { force: 0.0, plastic_overlap: p, branch: Branch::Apart };
        }
        let elastic = self.unloading_stiffness(p) * (x - p);
        // Width of the elastic range above p: K1 delta and K2 (delta - delta0) cross there.
        let width = 1.0 / self.stiffening();
        if x - p > width && p < self.plastic_overlap_max {
            let followed = x - width;
            return if followed < self.plastic_overlap_max {
                Response { force: x, plastic_overlap: followed, branch: Branch::PlasticLoading }
            } else {
                let p = self.plastic_overlap_max;
                Response {
                    force: self.k2_max * (x - p),
                    plastic_overlap: p,
                    branch: Branch::Elastic,
                }
            };
        }
        if elastic < -self.kc * x {
            let p = self.plastic_overlap_on_cohesion(x);
            return Response { force: -self.kc * x, plastic_overlap: p, branch: Branch::Cohesion };
        }
        Response { force: elastic, plastic_overlap: p, branch: Branch::Elastic }
    }

    /// The plastic overlap with `kappa(p) (x - p) = -kc x`.
    ///
    /// On the fluid branch `p = x (1 + kc/k2_max)`; below it the positive root of
    /// `q p^2 + (1 - q x) p - (1 + kc) x = 0`, q the [stiffening](Self::stiffening).
    fn plastic_overlap_on_cohesion(&self, x: f64) -> f64 {
        let fluid = x * (1.0 + self.kc / self.k2_max);
        if fluid >= self.plastic_overlap_max {
            return fluid;
        }
        positive_root(self.stiffening(), 1.0 - self.stiffening() * x, (1.0 + self.kc) * x)
    }

    /// Overlap at which the contact balances its adhesion, `X(p) = p + alpha/kappa(p)`.
    #[must_use]
    #[inline]
    pub fn equilibrium_overlap(&self, plastic_overlap: f64) -> f64 {
        plastic_overlap + self.adhesion / self.unloading_stiffness(plastic_overlap)
    }

    /// Inverse of [`equilibrium_overlap`](Self::equilibrium_overlap): the plastic overlap of a
    /// contact that is at rest at overlap `x >= alpha`.
    ///
    /// Below the fluid branch the positive root of `q p^2 + (1 - q x) p - (x - alpha) = 0`.
    #[must_use]
    #[inline]
    pub fn equilibrium_plastic_overlap(&self, overlap: f64) -> f64 {
        self.plastic_overlap_carrying(self.adhesion, overlap)
    }

    /// The plastic overlap with which a contact carries a force, of at most the overlap: `kappa(p) (x - p) = force`.
    #[must_use]
    #[inline]
    pub(crate) fn plastic_overlap_carrying(&self, force: f64, overlap: f64) -> f64 {
        let fluid = overlap - force / self.k2_max;
        if fluid >= self.plastic_overlap_max {
            return fluid;
        }
        positive_root(self.stiffening(), 1.0 - self.stiffening() * overlap, overlap - force)
    }

    /// `(dp/dX)_eq = 1/(1 - K2' fa/K2^2)`: the ratio of the rate of the plastic overlap to that of the
    /// overlap in equilibrium.
    #[must_use]
    #[inline]
    pub fn equilibrium_factor(&self, plastic_overlap: f64) -> f64 {
        if plastic_overlap >= self.plastic_overlap_max {
            return 1.0;
        }
        let kappa = self.unloading_stiffness(plastic_overlap);
        1.0 / (1.0 - self.stiffening() * self.adhesion / (kappa * kappa))
    }
}

/// Positive root of `a p^2 + b p - c = 0` for `a > 0`, `c >= 0`, without cancellation.
#[inline]
fn positive_root(a: f64, b: f64, c: f64) -> f64 {
    let root = (b * b + 4.0 * a * c).sqrt();
    if b > 0.0 { 2.0 * c / (b + root) } else { (root - b) / (2.0 * a) }
}
