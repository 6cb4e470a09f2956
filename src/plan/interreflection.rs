//! Interreflection, which is on where it adds more light than the preset tolerates.

use super::context::Context;
use super::effects::{Decision, ROUNDING};
use super::{Costs, LeftOut, Preset, SceneFeatures, Settings};
use crate::interreflection::MOST_RAYS_PER_USEFUL;
use crate::scene::Switch;

/// A ray from facet to facet, one lobe of it towards one node of the table, and its part of one pair of nodes [ns].
const RAY_NS: f64 = 1000.0;
const LOBE_NS: f64 = 1.5;
const PRODUCT_NS: f64 = 0.05;

impl SceneFeatures {
    /// The part of all directions in which facets see each other: `1 - A/S` for a surface that closes the plane,
    /// because every ray of uniform light ends on it once. For other surfaces it is a guess.
    pub fn hidden_directions(&self) -> f64 {
        if self.flat { 0.0 } else { (1.0 - 1.0 / self.area_ratio.max(1.0)).clamp(0.0, 1.0) }
    }

    /// Returns true if the share of bounced light must be measured: it decides whether interreflection is computed and at
    /// which resolution, and tells what is missing. It is not measured if facets see too little of each other to reach half of
    /// the tolerance, nor for drafts that are forced to leave the light out, which previews are.
    pub fn needs_bounced_share(&self, settings: &Settings) -> bool {
        let is_used = match settings.effects.interreflection {
            Switch::On | Switch::Auto => settings.preset != Preset::Reference,
            Switch::Off => settings.preset != Preset::Draft,
        };
        let is_small = self.closes_plane && 1.0 - 1.0 / self.facets_of_walk() < 0.5 * settings.bounced_tolerance();
        self.can_interreflect(settings) && is_used && !is_small
    }

    /// Returns true if interreflection is computed.
    pub fn interreflects(&self, settings: &Settings) -> bool {
        let is_needed = match settings.effects.interreflection {
            Switch::On => true,
            Switch::Off => false,
            Switch::Auto if settings.preset == Preset::Reference => true,
            Switch::Auto => self.bounced.is_some_and(|bounced| bounced.share > settings.bounced_tolerance()),
        };
        is_needed && self.can_interreflect(settings)
    }

    /// Returns true if all materials are matte.
    pub fn is_matte(&self) -> bool {
        self.narrowest_lobe == f32::INFINITY && self.lookups == 0
    }

    /// The part of the reflected light that facets send to each other and that is not computed; `None` if it was not measured.
    pub fn light_left_out(&self, is_computed: bool) -> Option<f64> {
        if is_computed || self.flat || self.materials == 0 { Some(0.0) } else { Some(self.bounced?.share) }
    }

    fn can_interreflect(&self, settings: &Settings) -> bool {
        !self.flat && self.materials > 0 && settings.preset != Preset::Wu2011
    }

    /// Facets that a walk meets: `Σ (ρ h)^k` for facets of albedo `ρ` that see each other in the part `h` of their
    /// directions.
    fn facets_of_walk(&self) -> f64 {
        1.0 / (1.0 - (self.albedo * self.hidden_directions()).clamp(0.0, 0.999))
    }

    /// Predicted milliseconds of interreflection.
    fn interreflection_ms(&self, settings: &Settings, costs: &Costs) -> f64 {
        let exchange = settings.interreflection(self);
        let hidden = self.hidden_directions();
        // A ray meets a facet in this part of the directions, and its own facet sees the sky in the others.
        let useful = (hidden * (1.0 - hidden)).max(1.0 / MOST_RAYS_PER_USEFUL);
        let rays = (exchange.useful_rays as f64 / useful).max(exchange.elements as f64);
        let (walks, nodes) = (rays * hidden, exchange.grid.len() as f64);
        let halves = self.mirrors.unwrap_or_default().map(|plane| if plane { 2.0 } else { 1.0 });
        let pairs = nodes * nodes / halves.iter().product::<f64>();
        let per_walk = self.facets_of_walk() * (RAY_NS + nodes * LOBE_NS);
        // The rays of a matte element share what reaches the viewers.
        let groups = if self.is_matte() { walks.min(exchange.elements as f64) } else { walks };
        let per_group = nodes * LOBE_NS + pairs * PRODUCT_NS;
        (rays * RAY_NS + walks * per_walk + groups * per_group) * 1e-6 / costs.threads
    }
}

/// The row of the table of effects.
pub(super) fn decide(context: &Context<'_>, switch: Switch) -> Decision {
    let Context { features, settings, costs, interreflection: on, .. } = *context;
    let tolerance = settings.bounced_tolerance();
    let ms = features.interreflection_ms(settings, costs);
    let exchange = settings.interreflection(features);
    let means = format!(
        "up to {} bounces of {} rays between {} facets",
        exchange.bounces, exchange.useful_rays, exchange.elements
    );
    let measured = features.bounced.map(|bounced| {
        let relation = if bounced.share > tolerance { "more than" } else { "within" };
        let [share, error, limit] = [bounced.share, bounced.std_error, tolerance].map(|part| part * 100.0);
        format!("{share:.1} ± {error:.1} % of the reflected light, {relation} the tolerance of {limit:.1} %")
    });
    let reason = match (on, measured) {
        _ if features.flat => "the tile is flat: no facet sees another".to_owned(),
        _ if features.materials == 0 => "nothing reflects".to_owned(),
        _ if settings.preset == Preset::Wu2011 => "the paper leaves it out".to_owned(),
        (true, Some(measured)) => format!("{measured}; {means}"),
        (true, None) if switch == Switch::On => format!("as asked; {means}"),
        (true, None) => format!("the reference always follows it; {means}"),
        (false, Some(measured)) if switch == Switch::Off => format!("{measured}; left out as asked"),
        (false, Some(measured)) => format!("{measured}; left out"),
        (false, None) if switch == Switch::Off => "left out as asked".to_owned(),
        (false, None) => format!(
            "facets see each other in {:.1} % of their directions: too little to matter; left out",
            features.hidden_directions() * 100.0
        ),
    };
    let missing = features.bounced.filter(|bounced| !on && bounced.share > tolerance);
    let left_out = missing.map(|bounced| LeftOut {
        share: bounced.share,
        std_error: bounced.std_error,
        tolerance,
        predicted_ms: ms,
    });
    let decision =
        Decision::new(on, reason).costs(if on { ms } else { 0.0 }).adds(features.bounced).leaves_out(left_out);
    // The share is no bound, unless there is nothing to add.
    if features.flat { decision.changes_at_most(ROUNDING) } else { decision }
}
