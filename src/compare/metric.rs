//! The names of the metrics, what they mean, and which values are better.

/// An error metric. Each has one name and one formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Metric {
    /// Mean squared error, linear.
    Mse,
    /// Its root, linear.
    Rmse,
    /// Mean of (a - b)^2 / (b^2 + 0.01), linear (Rousselle et al. 2011).
    RelMse,
    /// Mean absolute error, linear.
    Mae,
    /// The largest of the channels' |mean of a - b|, linear.
    Bias,
    /// The largest |a - b| of any pixel and channel, linear.
    Worst,
    /// Root mean squared error, display.
    GammaRmse,
    /// 20 log10(1 / gamma-rmse), display, dB; infinite for equal pictures.
    Psnr,
    /// Mean structural similarity (Wang et al. 2004), display.
    Ssim,
    /// Mean FLIP (Andersson et al. 2020), display.
    Flip,
    /// Root mean squared error of alpha.
    AlphaRmse,
    /// Mean absolute error of alpha.
    AlphaMae,
    /// |mean of a - b| of alpha.
    AlphaBias,
    /// The largest |a - b| of alpha.
    AlphaWorst,
    /// Pixels with a value that is not finite, of both pictures.
    NonFinite,
}

/// Which values are good.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sense {
    /// Errors: a limit is the greatest value that passes.
    Low,
    /// Similarities: a limit is the least value that passes.
    High,
}

impl Metric {
    /// All, in the order in which they are shown.
    pub const ALL: [Self; 15] = [
        Self::Mse,
        Self::Rmse,
        Self::RelMse,
        Self::Mae,
        Self::Bias,
        Self::Worst,
        Self::GammaRmse,
        Self::Psnr,
        Self::Ssim,
        Self::Flip,
        Self::AlphaRmse,
        Self::AlphaMae,
        Self::AlphaBias,
        Self::AlphaWorst,
        Self::NonFinite,
    ];

    /// The name, as on the command line and in JSON.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Mse => "mse",
            Self::Rmse => "rmse",
            Self::RelMse => "relmse",
            Self::Mae => "mae",
            Self::Bias => "bias",
            Self::Worst => "worst",
            Self::GammaRmse => "gamma-rmse",
            Self::Psnr => "psnr",
            Self::Ssim => "ssim",
            Self::Flip => "flip",
            Self::AlphaRmse => "alpha-rmse",
            Self::AlphaMae => "alpha-mae",
            Self::AlphaBias => "alpha-bias",
            Self::AlphaWorst => "alpha-worst",
            Self::NonFinite => "non-finite",
        }
    }

    /// The metric of this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|metric| metric.name() == name)
    }

    /// Formula and space, in a few words.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Mse => "linear: mean of (a - b)^2",
            Self::Rmse => "linear: root of mse",
            Self::RelMse => "linear: mean of (a - b)^2 / (b^2 + 0.01)",
            Self::Mae => "linear: mean of |a - b|",
            Self::Bias => "linear: largest of the channels' |mean of a - b|",
            Self::Worst => "linear: largest |a - b| of a channel",
            Self::GammaRmse => "display: root of the mean of (a - b)^2",
            Self::Psnr => "display: 20 log10(1 / gamma-rmse), dB",
            Self::Ssim => "display: mean of SSIM, Gaussian window of 11 x 11, RGB",
            Self::Flip => "display: mean of LDR-FLIP at 67.02 pixels per degree",
            Self::AlphaRmse => "alpha: root of the mean of (a - b)^2",
            Self::AlphaMae => "alpha: mean of |a - b|",
            Self::AlphaBias => "alpha: |mean of a - b|",
            Self::AlphaWorst => "alpha: largest |a - b|",
            Self::NonFinite => "pixels with a value that is not finite, in both",
        }
    }

    /// Which values are good.
    pub const fn sense(self) -> Sense {
        match self {
            Self::Psnr | Self::Ssim => Sense::High,
            _ => Sense::Low,
        }
    }

    /// Whether a value is within a limit. NaN never is.
    pub fn within(self, value: f64, limit: f64) -> bool {
        match self.sense() {
            Sense::Low => value <= limit,
            Sense::High => value >= limit,
        }
    }
}
