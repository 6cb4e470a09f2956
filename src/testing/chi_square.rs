//! Pearson's χ² test, for tests of sampling. Unit tests and integration tests include this file.

/// The probability that the counts of a correct routine differ from `expected` (relative frequencies) at least this
/// much. Cells with fewer than five expected counts are pooled.
pub fn p_value(counts: &[f64], expected: &[f64]) -> f64 {
    let total: f64 = counts.iter().sum();
    let parts: f64 = expected.iter().sum();
    let (mut statistic, mut cells) = (0.0, 0);
    let (mut pooled, mut pool) = (0.0, 0.0);
    let mut add = |count: f64, mean: f64| {
        statistic += (count - mean).powi(2) / mean;
        cells += 1;
    };
    for (count, part) in counts.iter().zip(expected) {
        let mean = part / parts * total;
        if mean < 5.0 {
            pooled += count;
            pool += mean;
        } else {
            add(*count, mean);
        }
    }
    if pool > 0.0 {
        add(pooled, pool);
    }
    upper_gamma(0.5 * f64::from(cells - 1), 0.5 * statistic)
}

/// Computes [`p_value`] of values that should be standard normal, in twelve bins that are half a standard deviation
/// wide; the outer bins are unbounded.
#[allow(dead_code, reason = "only one of the tests that include this file has normal values")]
pub fn p_value_of_normal(values: &[f64]) -> f64 {
    // Probabilities from Abramowitz and Stegun, Table 26.1.
    let below = [0.006_209_7, 0.022_750_1, 0.066_807_2, 0.158_655_3, 0.308_537_5, 0.5];
    let cumulative: Vec<f64> = below.into_iter().chain(below[..5].iter().rev().map(|p| 1.0 - p)).collect();
    let mut expected: Vec<f64> = cumulative.windows(2).map(|pair| pair[1] - pair[0]).collect();
    expected.insert(0, cumulative[0]);
    expected.push(1.0 - cumulative[10]);
    let mut counts = vec![0.0; expected.len()];
    for value in values {
        counts[((value + 3.0) / 0.5).floor().clamp(0.0, 11.0) as usize] += 1.0;
    }
    p_value(&counts, &expected)
}

/// The regularized upper incomplete gamma function `Q(a, x)`: its series below `a + 1`, and Lentz's continued fraction
/// above (Press et al., Numerical Recipes, Sec. 6.2).
fn upper_gamma(a: f64, x: f64) -> f64 {
    if x <= 0.0 || a <= 0.0 {
        return 1.0;
    }
    let scale = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut n) = (1.0 / a, 1.0 / a, a);
        while term > sum * 1e-15 {
            n += 1.0;
            term *= x / n;
            sum += term;
        }
        return 1.0 - sum * scale;
    }
    let mut b = x + 1.0 - a;
    let (mut c, mut d) = (1e300, 1.0 / b);
    let mut h = d;
    for n in 1..10_000 {
        let an = -f64::from(n) * (f64::from(n) - a);
        b += 2.0;
        d = 1.0 / (an * d + b);
        c = b + an / c;
        h *= d * c;
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    h * scale
}

/// `ln Γ(x)` by Stirling's series, shifted to arguments at which its error is below 1e-14.
fn ln_gamma(x: f64) -> f64 {
    let (mut x, mut shift) = (x, 0.0);
    while x < 12.0 {
        shift -= x.ln();
        x += 1.0;
    }
    let r = 1.0 / (x * x);
    let series = (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r / 1680.0))) / x;
    shift + (x - 0.5) * x.ln() - x + 0.5 * std::f64::consts::TAU.ln() + series
}

#[test]
fn p_values_agree_with_published_tables() {
    // The 5 % and 1 % points of χ² with 1, 10 and 100 degrees of freedom.
    for (degrees, five, one) in
        [(1.0, 3.841_459, 6.634_897), (10.0, 18.307_038, 23.209_251), (100.0, 124.342_113, 135.806_723)]
    {
        assert!((upper_gamma(0.5 * degrees, 0.5 * five) - 0.05).abs() < 1e-6, "{degrees}");
        assert!((upper_gamma(0.5 * degrees, 0.5 * one) - 0.01).abs() < 1e-6, "{degrees}");
    }
}
