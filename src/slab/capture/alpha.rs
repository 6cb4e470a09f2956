//! The parts of a point's model other than its distribution of slopes: α, the smoothness, and the roughness of masking.

use std::sync::Arc;

use glam::DVec3;

use super::bounced::{Bounced, fit_without};
use super::fit::{Equation, PointFit, Symmetry, View};
use super::lobe::{LobeOptics, PointModel, SlopeGrid};

/// A fitted point.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    pub model: PointModel,
    /// Scale of the lobe (`k_s`, Eq. 13).
    pub scale: f64,
    /// Relative L2 of the model against the samples.
    pub residual: f64,
    /// BTDF [1/sr] of light reflected inside that Eq. 14 took for diffuse, per scale.
    pub floor: f64,
}

/// Settings of a fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitSettings {
    pub optics: LobeOptics,
    pub grid: SlopeGrid,
    /// Weight of Eq. 17.
    pub smooth: f64,
    /// A known α.
    pub alpha: Option<f64>,
    /// Light that is reflected inside; absent if the samples hold none.
    pub bounced: Option<Arc<Bounced>>,
}

/// Steps of α that are compared first, and the width of the interval at which golden section between two of them ends.
const STEPS: usize = 4;
const ALPHA_TOLERANCE: f64 = 0.01;
/// Shift of the mean direction that Eq. 18 cannot tell from 0, over the deviation of the directions: the sum over dots is no
/// integral.
const SHIFT: f64 = 0.005;
/// Largest ratio of the squared errors of the free and the symmetric distribution at held-out samples at which the free one
/// is taken. A free
/// distribution may also fit what an inexact α leaves, and then is worse at other views.
const FREE_IS_BETTER: f64 = 0.4;
/// Part of the span outside which a distribution must not grow, and the largest growth of its mass there.
const OUTER: f64 = 0.8;
const MAX_GROWTH: f64 = 0.01;

/// Fits the model of one point to samples whose logarithms are [linearised](PointFit::linearised). For each α, the
/// distribution is solved anew. One camera takes the α that makes the product of Eqs. 15 and 18 least while the distribution
/// is point symmetric, and then frees the distribution if that predicts held-out samples much better: noise alone also makes
/// a distribution skewed. Eq. 18 alone, with the distribution kept while α moves as in the paper, hardly moves where the
/// distribution is narrow in the plane of incidence.
///
/// Several cameras take the α of the least Eq. 15 without any symmetry, because one camera cannot tell α from skewness.
/// Light that is reflected inside the slab is taken from the samples by the model, which is then fitted again.
/// `None` if no sample above 0 lies in the grid of slopes.
pub fn fit_point(views: &[View], settings: &FitSettings) -> Option<Fitted> {
    fit_without(views, settings.bounced.as_ref(), |views| fit_lobe(views, settings))
}

/// Fits samples without light that is reflected inside.
fn fit_lobe(views: &[View], settings: &FitSettings) -> Option<Fitted> {
    let measured = PointFit::new(views, &settings.optics, settings.grid)?;
    let fit = linearised(&measured, settings)?;
    let alpha = match settings.alpha {
        Some(alpha) => alpha,
        None if views.len() > 1 => least(|alpha| misfit(&fit, alpha, settings.smooth)),
        None => symmetric_alpha(&fit, settings.smooth)?,
    };
    let x = fit.solve(alpha, settings.smooth, fit.symmetry(), |_| true)?;
    let x = if views.len() > 1 { x } else { second_pass(&measured, x, alpha, settings.smooth)? };
    let residual = fit.residual(alpha, &x);
    let (model, scale) = fit.model(alpha, x);
    (scale > 0.0 && residual.is_finite()).then_some(Fitted { model, scale, residual, floor: 0.0 })
}

/// The given α, or a few from 0 to 1.
fn tried(settings: &FitSettings) -> Vec<f64> {
    settings.alpha.map_or_else(|| (0..=STEPS).map(step).collect(), |alpha| vec![alpha])
}

/// The equations linearised about the solution of the α that fits their logarithms best among a few. For each of these α the
/// distribution follows the samples, so that a nearby one is as good.
fn linearised(fit: &PointFit, settings: &FitSettings) -> Option<PointFit> {
    let solution = |alpha: f64| {
        let x = fit.solve(alpha, settings.smooth, fit.symmetry(), |_| true)?;
        Some((fit.misfit(alpha, &x, |_| true).0, alpha, x))
    };
    let (_, alpha, x) = tried(settings).into_iter().filter_map(solution).min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some(fit.linearised(alpha, &x))
}

/// The second pass of one camera: the free distribution if it predicts held-out samples much better than a symmetric one, and
/// if it does not grow at the rim, where few dots hold it; else `symmetric`. The measured equations decide, because those
/// that are linearised about a symmetric distribution are in its favour.
fn second_pass(measured: &PointFit, symmetric: Vec<f64>, alpha: f64, smooth: f64) -> Option<Vec<f64>> {
    let error = |symmetry| held_out_error(measured, alpha, smooth, symmetry).map_or(f64::MAX, |(misfit, _)| misfit);
    if error(Symmetry::WhereUnseen) >= FREE_IS_BETTER * error(Symmetry::Exact) {
        return Some(symmetric);
    }
    let free = |fit: &PointFit| fit.solve(alpha, smooth, Symmetry::WhereUnseen, |_| true);
    let free = free(&measured.linearised(alpha, &free(measured)?));
    let outside = |x: &[f64]| measured.model(alpha, x.to_vec()).0.outside(OUTER);
    Some(free.filter(|free| outside(free) < outside(&symmetric) + MAX_GROWTH).unwrap_or(symmetric))
}

/// Eq. 15 of the free distribution.
fn misfit(fit: &PointFit, alpha: f64, smooth: f64) -> f64 {
    let x = fit.solve(alpha, smooth, Symmetry::WhereUnseen, |_| true);
    x.map_or(f64::MAX, |x| fit.misfit(alpha, &x, |_| true).0)
}

/// The α of the least product of Eqs. 15 and 18 for a point-symmetric distribution.
fn symmetric_alpha(fit: &PointFit, smooth: f64) -> Option<f64> {
    let measured = centroid(fit, |equation| equation.sample.btdf.max(0.0))?;
    let square = |equation: &Equation| (equation.sample.i - measured).length_squared();
    let spread = weighted(fit, |equation| (equation.sample.btdf.max(0.0), DVec3::splat(square(equation))))?.x;
    let tolerance = SHIFT * SHIFT * spread;
    Some(least(|alpha| {
        let Some(x) = fit.solve(alpha, smooth, Symmetry::Exact, |_| true) else { return f64::MAX };
        let mean = centroid(fit, |equation| equation.ln_model(alpha, &x).exp());
        let shift = mean.map_or(f64::MAX, |mean| (mean - measured).length_squared());
        fit.misfit(alpha, &x, |_| true).0 * (tolerance + shift)
    }))
}

/// The mean direction of the light, weighted by a lobe (Eq. 18).
fn centroid(fit: &PointFit, btdf: impl Fn(&Equation) -> f64) -> Option<DVec3> {
    weighted(fit, |equation| (btdf(equation), equation.sample.i))
}

/// The mean of a vector over directions of the light, weighted by a BTDF.
fn weighted(fit: &PointFit, value: impl Fn(&Equation) -> (f64, DVec3)) -> Option<DVec3> {
    let (mut sum, mut total) = (DVec3::ZERO, 0.0);
    for equation in &fit.equations {
        let (btdf, vector) = value(equation);
        let weight = equation.sample.irradiance * btdf;
        sum += weight * vector;
        total += weight;
    }
    (total > 0.0 && total.is_finite()).then(|| sum / total)
}

/// An α that is tried first.
fn step(k: usize) -> f64 {
    k as f64 / STEPS as f64
}

/// The place of the least value of a function from 0 to 1: by golden section beside the least of a few steps.
fn least(value: impl Fn(f64) -> f64) -> f64 {
    let values: Vec<f64> = (0..=STEPS).map(|k| value(step(k))).collect();
    let best = values.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |(k, _)| k);
    let (low, high) = (step(best.saturating_sub(1)), step((best + 1).min(STEPS)));
    let inside = golden_section(&value, (low, high), ALPHA_TOLERANCE);
    // The ends are places of their own, which golden section does not reach.
    if value(inside) < values[best] { inside } else { step(best) }
}

/// The place of the least value of a function with one minimum in an interval, to within half of `tolerance`.
fn golden_section(value: impl Fn(f64) -> f64, (mut low, mut high): (f64, f64), tolerance: f64) -> f64 {
    let part = (5f64.sqrt() - 1.0) / 2.0;
    let (mut a, mut b) = (high - part * (high - low), low + part * (high - low));
    let (mut at_a, mut at_b) = (value(a), value(b));
    while high - low > tolerance {
        if at_a < at_b {
            (high, b, at_b) = (b, a, at_a);
            a = high - part * (high - low);
            at_a = value(a);
        } else {
            (low, a, at_a) = (a, b, at_b);
            b = low + part * (high - low);
            at_b = value(b);
        }
    }
    0.5 * (low + high)
}

/// Weights of Eq. 17 that are tried, from smooth to rough.
const SMOOTH: [f64; 5] = [3.0, 1.0, 0.3, 0.1, 0.03];
/// One of this many samples is held out.
const HELD_OUT: usize = 5;

/// The misfit of held-out samples of a solution of the others, and the sum of their weights.
fn held_out_error(fit: &PointFit, alpha: f64, smooth: f64, symmetry: Symmetry) -> Option<(f64, f64)> {
    let takes_part = |k: usize| !k.is_multiple_of(HELD_OUT);
    let x = fit.solve(alpha, smooth, symmetry, takes_part)?;
    Some(fit.misfit(alpha, &x, |k| !takes_part(k)))
}

/// The weight of Eq. 17 that best predicts held-out samples of all given points. Clean slices want little smoothing, noise
/// and long tails much.
pub fn choose_smoothness(points: &[Vec<View>], settings: &FitSettings) -> f64 {
    let error = |smooth: f64| {
        let mut sums = (0.0, 0.0);
        for views in points {
            let Some(fit) = PointFit::new(views, &settings.optics, settings.grid) else { continue };
            // A wrong α would ask for more smoothing.
            let errors =
                tried(settings).into_iter().filter_map(|alpha| held_out_error(&fit, alpha, smooth, fit.symmetry()));
            let (misfit, weight) = errors.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or_default();
            sums.0 += misfit;
            sums.1 += weight;
        }
        if sums.1 > 0.0 { sums.0 / sums.1 } else { f64::MAX }
    };
    let errors = SMOOTH.map(error);
    let best = errors.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1)).map_or(1, |(k, _)| k);
    SMOOTH[best]
}

/// The roughness of masking of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shadowing {
    /// Value of Levenberg and Marquardt's method with α and the distribution given.
    pub roughness: f64,
    /// False if other values fit as well once the distribution follows them.
    pub is_determined: bool,
}

/// Misfit over the least misfit below which a roughness of masking fits as well.
const SAME_MISFIT: f64 = 1.1;

/// Searches the roughness of masking by Levenberg and Marquardt's method, with α and the distribution given, and finds out
/// whether the samples determine it: the distribution is solved again for a small and a large roughness.
pub fn shadowing(views: &[View], settings: &FitSettings, fitted: &Fitted) -> Shadowing {
    let alpha = fitted.model.alpha;
    let optics = |roughness: f64| LobeOptics::new(settings.optics.eta, roughness);
    let x: Vec<f64> = fitted.model.ln_density.iter().map(|value| value + fitted.scale.ln()).collect();
    let residuals = |roughness: f64| -> Vec<f64> {
        let fit = PointFit::new(views, &optics(roughness), settings.grid);
        let equations = fit.iter().flat_map(|fit| &fit.equations);
        equations.map(|equation| equation.weight * (equation.ln_model(alpha, &x) - equation.ln_btdf)).collect()
    };
    let roughness = levenberg_marquardt(residuals, settings.optics.shadowing);
    let refitted = |roughness: f64| -> f64 {
        let fit = PointFit::new(views, &optics(roughness), settings.grid);
        let misfit = fit.and_then(|fit| {
            let x = fit.solve(alpha, settings.smooth, Symmetry::WhereUnseen, |_| true)?;
            Some(fit.misfit(alpha, &x, |_| true).0)
        });
        misfit.unwrap_or(f64::MAX)
    };
    let (low, high) = (refitted(0.05), refitted(0.5));
    let least = low.min(high).min(refitted(roughness));
    Shadowing { roughness, is_determined: low > SAME_MISFIT * least && high > SAME_MISFIT * least }
}

/// The value of one parameter between 1e-3 and 2 that makes the sum of squared residuals least.
fn levenberg_marquardt(residuals: impl Fn(f64) -> Vec<f64>, start: f64) -> f64 {
    let squares = |values: &[f64]| values.iter().map(|value| value * value).sum::<f64>();
    let (mut at, mut damping) = (start, 1e-2);
    let mut values = residuals(at);
    for _ in 0..30 {
        let step = 1e-4;
        let ahead = residuals(at + step);
        let slope: Vec<f64> = ahead.iter().zip(&values).map(|(b, a)| (b - a) / step).collect();
        let curvature = squares(&slope);
        let gradient: f64 = slope.iter().zip(&values).map(|(slope, value)| slope * value).sum();
        if curvature.is_nan() || curvature <= 0.0 {
            break;
        }
        let next = (at - gradient / (curvature * (1.0 + damping))).clamp(1e-3, 2.0);
        let found = residuals(next);
        if squares(&found) < squares(&values) {
            let change = (next - at).abs();
            (at, values) = (next, found);
            damping *= 0.3;
            if change < 1e-5 {
                break;
            }
        } else {
            damping *= 10.0;
            if damping > 1e6 {
                break;
            }
        }
    }
    at
}
