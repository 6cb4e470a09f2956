//! Arguments of the subcommands.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// Compute how a surface with tiny structures looks from far away.
#[derive(Debug, Parser)]
#[command(name = "biscale", version, about, args_conflicts_with_subcommands = true)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Scene to open in the editor: a file, or the name of a shipped scene.
    pub scene: Option<String>,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Open the editor, as the program does without a command.
    Edit {
        /// A scene file, the name of a shipped scene, or `-` for a scene on standard input.
        scene: Option<String>,
        /// Print on standard error the milliseconds from the start of the program to the window, the GPU and the first
        /// image; then quit.
        #[arg(long)]
        start_times: bool,
    },
    /// Render the scene's object as an image (.png or linear .exr).
    Render(RenderArgs),
    /// Evaluate the effective BRDF [1/sr], with the light's cosine, at the direction pairs of a CSV file.
    Eval(EvalArgs),
    /// Write the effective BRDF as a table. Formats by ending: .npz .csv .exr .bsdf .binary .xml .bin .astm.
    Export(ExportArgs),
    /// Filter the scene's colour map: at the queries of a CSV file, as a table, or as an image beside the naive map and the reference.
    Filter(FilterArgs),
    /// Fit Lambertian + Cook-Torrance and a GGX base, print their errors, and write glTF, MaterialX or an image.
    Fit(FitArgs),
    /// Write the tile itself: .obj, .stl (closed, in mm), .png (16-bit heights), .svg or .pdf (a pattern to fold).
    Tile(TileArgs),
    /// Write the lobe that a slab makes of light from one direction, and where the light goes. A scene needs `[slab]`.
    Transmit(TransmitArgs),
    /// Make the photographs that a monitor and a camera would take of a slab, for `capture`.
    Rig(RigArgs),
    /// Capture a sheet from photographs of it before a monitor: an SVBTDF (.npz) and a scene that shows it (.toml).
    Capture(CaptureArgs),
    /// List every effect: whether it is on, why, and its cost.
    Plan(PlanArgs),
    /// Factor the rotated BRDF of every material and list its size and rank (Table 3 of Wu et al. 2011).
    Basis(SceneArgs),
    /// Time the stages from an edit to the effective BRDF or the image.
    Profile(ProfileArgs),
    /// Measure accuracy against time for every setting, the presets and combinations of settings.
    Report(ReportArgs),
    /// Show the results that are cached on disk, and their folder; or remove them.
    Cache(CacheArgs),
    /// List the scenes that ship with the program.
    Materials(MaterialsArgs),
}

impl Command {
    /// The arguments of the scene, of commands that take one.
    pub fn scene(&self) -> Option<&SceneArgs> {
        match self {
            Self::Render(args) => Some(&args.scene),
            Self::Eval(args) => Some(&args.scene),
            Self::Export(args) => Some(&args.scene),
            Self::Filter(args) => Some(&args.scene),
            Self::Fit(args) => Some(&args.scene),
            Self::Tile(args) => Some(&args.scene),
            Self::Transmit(args) => Some(&args.scene),
            Self::Rig(args) => Some(&args.scene),
            Self::Plan(args) => Some(&args.scene),
            Self::Basis(args) => Some(args),
            Self::Profile(args) => Some(&args.scene),
            Self::Edit { .. } | Self::Capture(_) | Self::Report(_) | Self::Cache(_) | Self::Materials(_) => None,
        }
    }
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum QualityArg {
    Draft,
    Standard,
    Fine,
    Reference,
    Wu2011,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum BackendArg {
    Auto,
    Gpu,
    Cpu,
}

#[derive(Debug, Args)]
pub struct SceneArgs {
    /// A scene file, the name of a shipped scene (see `biscale materials`), or `-` for a scene on standard input.
    pub scene: String,
    /// Override any field of the scene: `--set material.default.brdf.roughness=0.3` (repeatable).
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Preset of accuracy and cost.
    #[arg(long)]
    pub quality: Option<QualityArg>,
    /// Force an effect of the plan on or off: `--effect interreflection=on` (repeatable).
    #[arg(long = "effect", value_name = "NAME=on|off|auto", value_parser = super::parse_effect)]
    pub effects: Vec<String>,
    /// Choose the cheapest settings whose PSNR against a reference of the scene reaches X dB.
    #[arg(long, value_name = "X", value_parser = super::parse_positive)]
    pub target_db: Option<f64>,
    /// Choose the best settings that take at most Y ms from an edit of the geometry to the effective BRDF.
    #[arg(long, value_name = "Y", value_parser = super::parse_positive, conflicts_with = "target_db")]
    pub budget_ms: Option<f64>,
    /// Processor that computes: the CPU or a GPU.
    #[arg(long)]
    pub backend: Option<BackendArg>,
    /// Seed of all sampling.
    #[arg(long, value_parser = super::parse_seed)]
    pub seed: Option<u64>,
    /// Print a machine-readable report on standard output.
    #[arg(long)]
    pub json: bool,
    /// Print no notes and no progress on standard error.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct PlanArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Also force each effect on and off, and print its time and the change of the effective BRDF and the image.
    #[arg(long)]
    pub measure: bool,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub caching: CachingArgs,
    /// Image to write: .png (tone-mapped) or .exr (linear). With --zoom, a folder.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Width and height in pixels.
    #[arg(long, default_value = "768x768", value_parser = super::parse_size)]
    pub size: [usize; 2],
    /// Samples per pixel side at edges.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=8))]
    pub samples: u8,
    /// Zoom towards the middle of the image, from FROM to TO pixels per tile: frames 0000.png ... and zoom.csv, the mean
    /// radiance of the tile in each frame. The scene needs a colour map.
    #[arg(long, value_name = "FROM:TO:FRAMES", value_parser = super::render_zoom::parse)]
    pub zoom: Option<super::render_zoom::Zoom>,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct EvalArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub caching: CachingArgs,
    /// CSV file with the header theta_i,phi_i,theta_o,phi_o (radians); `-` is standard input.
    #[arg(long)]
    pub pairs: PathBuf,
    /// CSV file to write; `-` is standard output.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Also write the columns se_r,se_g,se_b: the standard error of a reference, or the estimated error of other
    /// qualities. They are empty with `wu2011`.
    #[arg(long, visible_alias = "errors")]
    pub standard_error: bool,
}

/// Method by which `filter` evaluates queries.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum FilterMethod {
    /// The means of the maps.
    Filtered,
    /// The colour of the drivers' means.
    Naive,
    /// Quadrature, supersampling and ray casting.
    Truth,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct FilterArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub caching: CachingArgs,
    /// CSV file of queries. Its header decides what is evaluated: `mean,deviation`, `a`, `theta_o,phi_o`,
    /// `theta_i,phi_i,theta_o,phi_o` or `u,v,width_u,width_v,angle`; `-` is standard input.
    #[arg(long, requires = "output", required_unless_present_any = ["table", "side_by_side"])]
    pub queries: Option<PathBuf>,
    /// CSV file to write: the queries and their results; `-` is standard output.
    #[arg(short, long, requires = "queries")]
    pub output: Option<PathBuf>,
    /// Layer to evaluate, by its name. Pairs of directions evaluate all layers together.
    #[arg(long, value_name = "NAME")]
    pub layer: Option<String>,
    /// Evaluation of the queries.
    #[arg(long, value_enum, default_value_t = FilterMethod::Filtered)]
    pub method: FilterMethod,
    /// Write the prefiltered table of a layer: .exr or .npz.
    #[arg(long, value_name = "FILE")]
    pub table: Option<PathBuf>,
    /// Write an image (.png): the naive map, the supersampled reference and the filtered map from left to right, and below them
    /// ten times the differences from the reference.
    #[arg(long, value_name = "FILE")]
    pub side_by_side: Option<PathBuf>,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct ExportArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub caching: CachingArgs,
    /// Table to write. The ending selects the format. `-` is standard output (CSV).
    #[arg(short, long)]
    pub output: PathBuf,
    /// Steps of theta and phi for both directions. The default depends on the format.
    #[arg(long, value_name = "THETAxPHI", value_parser = super::parse_size)]
    pub resolution: Option<[usize; 2]>,
    /// Steps of theta and phi for the second direction alone. In .bsdf: samples along the two axes of each warp.
    #[arg(long, value_name = "THETAxPHI", value_parser = super::parse_size)]
    pub resolution_o: Option<[usize; 2]>,
    /// Content of a Radiance .xml: 145 x 145 patches, or a tensor tree for sharp or anisotropic BRDFs.
    #[arg(long, value_enum, default_value_t = RadianceArg::Klems)]
    pub radiance: RadianceArg,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct FitArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// File to write (repeatable). The ending selects the content: .gltf and .mtlx (the GGX base), .json (all numbers),
    /// .png or .exr (the object in the effective BRDF, in the Cook-Torrance and in the GGX fit; the differences are
    /// below them).
    #[arg(short, long)]
    pub output: Vec<PathBuf>,
    /// Width and height in pixels of each part of the image.
    #[arg(long, default_value = "384x384", value_parser = super::parse_size)]
    pub size: [usize; 2],
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct TileArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// File to write. The ending selects the format.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Number of periods in x and y.
    #[arg(long, default_value = "1x1", value_parser = super::parse_size)]
    pub repeat: [usize; 2],
    /// Scale of physical models (.stl, .svg, .pdf): with 20, a tile unit of 1 mm is 20 mm long.
    #[arg(long, default_value_t = 1.0)]
    pub scale: f32,
    /// Thickness under the lowest point of the .stl, in millimetres. The default is a tenth of the longer side.
    #[arg(long, value_name = "MM")]
    pub base: Option<f32>,
    /// Height samples per period in x and y (.stl, .png).
    #[arg(long, default_value = "256x256", value_parser = super::parse_size)]
    pub samples: [usize; 2],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum TransmitMethod {
    /// The dual-microfacet model (Dai et al. 2009, Eq. 11).
    Dual,
    /// A sum over facets of the smoother face (Eq. 1).
    Faces,
    /// Photons through random facets of both faces.
    Truth,
    /// One rough face and one refraction (Walter et al. 2007), for comparison.
    Walter,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct TransmitArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Lobe over the disc (o.x, o.y) and in the plane of incidence: .csv or .png. Needed unless `--json` is given.
    #[arg(short, long, required_unless_present = "json")]
    pub output: Option<PathBuf>,
    /// Polar angle of the light above the top face [degrees].
    #[arg(long, default_value_t = 30.0, value_parser = super::transmit::parse_theta)]
    pub theta_i: f64,
    /// Azimuth of the light [degrees].
    #[arg(long, default_value_t = 0.0, value_parser = super::transmit::parse_phi)]
    pub phi_i: f64,
    /// Method for the lobe; without it, the plan decides.
    #[arg(long, value_enum)]
    pub method: Option<TransmitMethod>,
}

/// The light that simulated photographs show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RigSource {
    /// The slab as `eval` computes it.
    Model,
    /// Photons through random facets of both faces.
    Truth,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct RigArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Folder for rig.toml and the images.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Dots of the monitor along x and y.
    #[arg(long, default_value = "40x40", value_parser = super::parse_size)]
    pub dots: [usize; 2],
    /// Columns and rows of the images.
    #[arg(long, default_value = "64x64", value_parser = super::parse_size)]
    pub pixels: [usize; 2],
    /// Number of cameras: one at 45°, and one that looks straight.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2))]
    pub cameras: u8,
    /// Relative noise of the pixels. Every pixel also gets constant noise: a hundredth of this value times the brightest pixel.
    #[arg(long, default_value_t = 0.01, value_parser = super::parse_part)]
    pub noise: f64,
    /// The light that the photographs show.
    #[arg(long, value_enum, default_value_t = RigSource::Model)]
    pub source: RigSource,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct CaptureArgs {
    /// Folder with rig.toml and the images.
    pub folder: PathBuf,
    /// File to write (repeatable): .npz (the SVBTDF, needed), .toml (a scene that shows it), .png or .exr (residuals).
    #[arg(short, long, required = true)]
    pub output: Vec<PathBuf>,
    /// The known fraction of the roughness on the side of the monitor, 0 to 1.
    #[arg(long, value_parser = super::parse_part)]
    pub alpha: Option<f64>,
    /// Fit every pixel. By default, 1 % of the pixels are fitted, and the others are interpolated between them.
    #[arg(long)]
    pub every_pixel: bool,
    /// Seed of the choice of representatives.
    #[arg(long, default_value_t = 1, value_parser = super::parse_seed)]
    pub seed: u64,
    /// Print a machine-readable report on standard output.
    #[arg(long)]
    pub json: bool,
    /// Print no notes and no progress on standard error.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum RadianceArg {
    Klems,
    TensorTree,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum EditArg {
    /// The first number of the tile's geometry.
    Geometry,
    /// The first number of a BRDF.
    Brdf,
    /// The colour of the first material.
    Color,
    /// The azimuth of the camera.
    Camera,
    /// A face of a slab.
    Face,
    /// The index of a slab.
    Eta,
    /// The thickness of a slab.
    Thickness,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct ProfileArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Parameter to edit. Without this option, every run computes everything.
    #[arg(long)]
    pub edit: Option<EditArg>,
    /// Time from the edit to the image. An image that the GPU computes stays on the GPU.
    #[arg(long = "picture", requires = "edit")]
    pub image: bool,
    /// Width and height in pixels of the image of `--picture` and of `--edit camera`.
    #[arg(long, default_value = "384x384", value_parser = super::parse_size)]
    pub size: [usize; 2],
    /// Number of timed runs after one warm-up run. The medians are printed.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeat: u32,
}

#[derive(Debug, Args)]
#[command(allow_negative_numbers = true)]
pub struct ReportArgs {
    /// Scene files, names of shipped scenes, or `-` for a scene on standard input.
    #[arg(required = true)]
    pub scenes: Vec<String>,
    /// Folder for report.html, report.csv and report.json. An interrupted run continues from the files in it.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Override any field of each scene: `--set material.default.brdf.roughness=0.3` (repeatable).
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Minutes per scene. The presets are always measured.
    #[arg(long, default_value_t = 5.0, value_parser = super::parse_minutes)]
    pub minutes: f64,
    /// Number of direction pairs over which errors are computed.
    #[arg(long, default_value_t = 500, value_parser = super::parse_count)]
    pub pairs: usize,
    /// Number of candidates that vary all settings at once.
    #[arg(long, default_value_t = 40)]
    pub combinations: usize,
    /// Print no progress and no notes on standard error.
    #[arg(long)]
    pub quiet: bool,
}

/// Arguments of commands that use the cache.
#[derive(Debug, Args)]
pub struct CachingArgs {
    /// Compute everything, and neither read nor write the cache (see `biscale cache`).
    #[arg(long)]
    pub no_cache: bool,
}

#[derive(Debug, Args)]
pub struct CacheArgs {
    /// Remove all cached results.
    #[arg(long)]
    pub clear: bool,
    /// Print a machine-readable report.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct MaterialsArgs {
    /// Print a machine-readable report.
    #[arg(long)]
    pub json: bool,
}
