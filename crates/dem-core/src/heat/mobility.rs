//! Mobility over temperature.

use super::error::{HeatError, temperature, within};

/// Gas constant \[J/(mol K)\], exact since 2019.
pub const GAS_CONSTANT: f64 = 8.314_462_618_153_24;

/// How the rates of zipping and stretching go with the temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum MobilityLaw {
    /// `m = exp(-(Ea/Rg) (1/T - 1/T_ref))`: melts far above their glass transition (100 K and more), semicrystalline
    /// ones like PA12 and PEEK above their melting point.
    Arrhenius {
        /// Activation energy of flow Ea \[J/mol\], 0 to 460 `Rg T_ref`.
        activation_energy_j_per_mol: f64,
        /// Temperature at which m = 1 \[K\].
        reference_k: f64,
    },
    /// `log10 m = c1 (T - T_ref)/(c2 + T - T_ref)`, and m = 0 at and below `T_ref - c2`: amorphous melts from the glass
    /// transition to about 100 K above it.
    ///
    /// M.L. Williams, R.F. Landel, J.D. Ferry, J. Am. Chem. Soc. 77 (1955) 3701.
    Wlf {
        /// c1, 0 to 200.
        c1: f64,
        /// c2 \[K\].
        c2_k: f64,
        /// Temperature at which m = 1, that c1 and c2 belong to \[K\].
        reference_k: f64,
    },
    /// `m = exp(B/(T_ref - T0) - B/(T - T0))`, and m = 0 at and below T0: WLF with `c2 = T_ref - T0` and
    /// `c1 = B/(c2 ln 10)`.
    ///
    /// H. Vogel, Phys. Z. 22 (1921) 645; G.S. Fulcher, J. Am. Ceram. Soc. 8 (1925) 339.
    Vogel {
        /// B \[K\].
        b_k: f64,
        /// Vogel temperature T0 \[K\], below the reference.
        t0_k: f64,
        /// Temperature at which m = 1 \[K\].
        reference_k: f64,
    },
}

/// A mobility over temperature, checked: 1 at its reference temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mobility {
    law: MobilityLaw,
    frozen_below_k: Option<f64>,
    pub(super) vogel: Vogel,
}

/// The one form of all laws, `ln m = at_reference - b/(T - t0)`. Arrhenius is `t0 = 0`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Vogel {
    b_k: f64,
    pub(super) t0_k: f64,
    at_reference: f64,
}

impl Vogel {
    /// m; 0 at and below `t0`.
    #[inline]
    pub(super) fn at(&self, temperature_k: f64) -> f64 {
        let above = temperature_k - self.t0_k;
        if above > 0.0 { (self.at_reference - self.b_k / above).exp() } else { 0.0 }
    }
}

/// Largest `ln m` at infinite temperature: reduced times stay numbers.
const LARGEST_LN: f64 = 460.0;

impl Mobility {
    /// # Errors
    ///
    /// [`HeatError::Field`] for a constant out of its range.
    pub fn new(law: MobilityLaw) -> Result<Self, HeatError> {
        let reference_k = law.reference_k();
        temperature("reference_k", reference_k)?;
        let (b_k, t0_k) = match law {
            MobilityLaw::Arrhenius { activation_energy_j_per_mol: energy, .. } => {
                let high = LARGEST_LN * GAS_CONSTANT * reference_k;
                let remedy = "give the activation energy in J/mol, from 0 to 460 times Rg T_ref (1e6 at 273 K)";
                within("activation_energy_j_per_mol", energy, (0.0, high), remedy)?;
                (energy / GAS_CONSTANT, 0.0)
            }
            MobilityLaw::Wlf { c1, c2_k, .. } => {
                within("c1", c1, (0.0, 200.0), "use 0 to 200; 17.4 is the value of many polymers")?;
                within("c2_k", c2_k, (1e-3, 1e6), "give c2 in kelvin, 1e-3 to 1e6")?;
                (c1 * std::f64::consts::LN_10 * c2_k, reference_k - c2_k)
            }
            MobilityLaw::Vogel { b_k, t0_k, .. } => {
                let (least, most) = (reference_k - 1e6, reference_k - 1e-3);
                within("t0_k", t0_k, (least, most), "it must be below the reference temperature")?;
                let high = LARGEST_LN * (reference_k - t0_k);
                within("b_k", b_k, (0.0, high), "use 0 to 460 times (T_ref - T0)")?;
                (b_k, t0_k)
            }
        };
        let vogel = Vogel { b_k, t0_k, at_reference: b_k / (reference_k - t0_k) };
        Ok(Self { law, frozen_below_k: None, vogel })
    }

    /// The same with m = 0 below a temperature: the glass transition, or the temperature at which the melt crystallises.
    ///
    /// # Errors
    ///
    /// [`HeatError::Field`] for one that is no temperature.
    pub fn frozen_below(self, frozen_below_k: f64) -> Result<Self, HeatError> {
        temperature("frozen_below_k", frozen_below_k)?;
        Ok(Self { frozen_below_k: Some(frozen_below_k), ..self })
    }

    /// The law.
    #[must_use]
    pub fn law(&self) -> MobilityLaw {
        self.law
    }

    /// The temperature below which m = 0 \[K\], where one was given.
    #[must_use]
    pub fn frozen_below_k(&self) -> Option<f64> {
        self.frozen_below_k
    }

    /// m at a temperature \[K\]; 0 where nothing moves.
    #[must_use]
    pub fn at(&self, temperature_k: f64) -> f64 {
        if temperature_k < self.floor_k() { 0.0 } else { self.vogel.at(temperature_k) }
    }

    /// Temperature below which m = 0, whatever the reason \[K\].
    pub(super) fn floor_k(&self) -> f64 {
        let vogel = if self.vogel.b_k > 0.0 { self.vogel.t0_k.max(0.0) } else { 0.0 };
        self.frozen_below_k.unwrap_or(0.0).max(vogel)
    }
}

impl MobilityLaw {
    /// Temperature at which m = 1 \[K\].
    #[must_use]
    pub fn reference_k(&self) -> f64 {
        match *self {
            Self::Arrhenius { reference_k, .. }
            | Self::Wlf { reference_k, .. }
            | Self::Vogel { reference_k, .. } => reference_k,
        }
    }
}
