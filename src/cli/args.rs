//! The arguments of every subcommand.

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand, ValueEnum};

/// What does a surface with tiny structures look like from far away?
#[derive(Debug, Parser)]
#[command(name = "biscale", version, about, args_conflicts_with_subcommands = true)]
pub struct Cli {
    #[command(subcommand)]
    pub command: Option<Command>,
    /// Opens the editor on this scene: a file, or the name of a shipped one.
    pub scene: Option<String>,
}

#[derive(Debug, Subcommand)]
pub enum Command {
    /// Open the editor (also without this word).
    Edit {
        /// A scene file, or the name of a shipped material.
        scene: Option<String>,
        /// Say on standard error when the window, its device and the first picture were there, from the start of the program,
        /// and quit.
        #[arg(long)]
        start_times: bool,
    },
    /// Shade the scene's object and write a picture (.png or linear .exr).
    Render(RenderArgs),
    /// Evaluate f̄ [1/sr] (the light's cosine included) at direction pairs of a CSV file.
    Eval(EvalArgs),
    /// Write the effective BRDF as a table, by the file's ending: .npz .csv .exr .bsdf .binary .xml .bin .astm.
    Export(ExportArgs),
    /// Fit Lambertian + Cook-Torrance and a GGX base, say what they lose, and write glTF, MaterialX or a picture of it.
    Fit(FitArgs),
    /// Write the tile itself: .obj, .stl (closed, millimetres), .png (16-bit heights), .svg or .pdf (a pattern to fold).
    Tile(TileArgs),
    /// List every effect: on or off, why, and what it costs.
    Plan(PlanArgs),
    /// Factor every material's rotated BRDF and list the sizes (Table 3 of Wu et al. 2011).
    Basis(SceneArgs),
    /// Time the stages from an edit to the effective BRDF (or the picture).
    Profile(ProfileArgs),
    /// Measure accuracy against time: every knob, the presets, and combinations, against the reference.
    Report(ReportArgs),
    /// Say what is kept on disk between runs, and where; or remove it.
    Cache(CacheArgs),
    /// List the materials that ship with the program.
    Materials(MaterialsArgs),
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Quality {
    Draft,
    Standard,
    Fine,
    Reference,
    Wu2011,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
pub enum Backend {
    Auto,
    Gpu,
    Cpu,
}

#[derive(Debug, Args)]
pub struct SceneArgs {
    /// A scene file, or the name of a shipped material (see `biscale materials`).
    pub scene: String,
    /// Override any field: `--set material.default.brdf.roughness=0.3` (repeatable).
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Preset of accuracy and cost.
    #[arg(long)]
    pub quality: Option<Quality>,
    /// Force an effect of the plan on or off: `--effect interreflection=on` (repeatable).
    #[arg(long = "effect", value_name = "NAME=on|off|auto", value_parser = super::parse_effect)]
    pub effects: Vec<String>,
    /// Choose the cheapest settings whose PSNR against a reference of the scene reaches so many decibels.
    #[arg(long, value_name = "X", value_parser = super::parse_positive)]
    pub target_db: Option<f64>,
    /// Choose the best settings within so many milliseconds from an edit of the geometry to the effective BRDF.
    #[arg(long, value_name = "Y", value_parser = super::parse_positive, conflicts_with = "target_db")]
    pub budget_ms: Option<f64>,
    /// Where to compute.
    #[arg(long)]
    pub backend: Option<Backend>,
    /// Seed of all sampling.
    #[arg(long)]
    pub seed: Option<u64>,
    /// Machine-readable output on standard output.
    #[arg(long)]
    pub json: bool,
    /// No notes on standard error.
    #[arg(long)]
    pub quiet: bool,
}

#[derive(Debug, Args)]
pub struct PlanArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Also force each effect on and off: milliseconds, and what it changes in f̄ and in the picture.
    #[arg(long)]
    pub measure: bool,
}

#[derive(Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub keeping: KeepingArgs,
    /// The picture to write: .png (tone-mapped) or .exr (linear).
    #[arg(short, long)]
    pub output: PathBuf,
    /// Width and height in pixels.
    #[arg(long, default_value = "768x768", value_parser = super::parse_size)]
    pub size: [usize; 2],
    /// Samples a pixel side at edges.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u8).range(1..=8))]
    pub samples: u8,
}

#[derive(Debug, Args)]
pub struct EvalArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub keeping: KeepingArgs,
    /// CSV with the header theta_i,phi_i,theta_o,phi_o (radians); `-` is standard input.
    #[arg(long)]
    pub pairs: PathBuf,
    /// CSV to write; `-` is standard output.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Also write the columns se_r,se_g,se_b: the standard error (at `reference`; zero elsewhere).
    #[arg(long)]
    pub standard_error: bool,
}

#[derive(Debug, Args)]
pub struct ExportArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    #[command(flatten)]
    pub keeping: KeepingArgs,
    /// The table to write; the ending chooses the format. `-` is standard output (CSV).
    #[arg(short, long)]
    pub output: PathBuf,
    /// Steps of theta and phi for each direction; without it, what suits the format.
    #[arg(long, value_name = "THETAxPHI", value_parser = super::parse_size)]
    pub resolution: Option<[usize; 2]>,
    /// The same for the second direction alone (in .bsdf: samples along the two axes of each warp).
    #[arg(long, value_name = "THETAxPHI", value_parser = super::parse_size)]
    pub resolution_o: Option<[usize; 2]>,
    /// What a Radiance .xml holds: 145 x 145 patches, or a tensor tree for what is sharp or anisotropic.
    #[arg(long, value_enum, default_value_t = Radiance::Klems)]
    pub radiance: Radiance,
}

#[derive(Debug, Args)]
pub struct FitArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Files to write, by ending (repeatable): .gltf and .mtlx (the GGX base), .json (all numbers), .png or .exr (the object
    /// in the effective BRDF, in the Cook-Torrance and in the GGX fit; under them the differences).
    #[arg(short, long)]
    pub output: Vec<PathBuf>,
    /// Width and height of each of the pictures.
    #[arg(long, default_value = "384x384", value_parser = super::parse_size)]
    pub size: [usize; 2],
}

#[derive(Debug, Args)]
pub struct TileArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// The file to write; the ending chooses what.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Periods in x and y.
    #[arg(long, default_value = "1x1", value_parser = super::parse_size)]
    pub repeat: [usize; 2],
    /// Enlarges what is made of matter (.stl, .svg, .pdf): 20 makes a tile unit of 1 mm 20 mm long.
    #[arg(long, default_value_t = 1.0)]
    pub scale: f32,
    /// Thickness under the lowest point of the .stl, in millimetres; without it a tenth of the longer side.
    #[arg(long, value_name = "MM")]
    pub base: Option<f32>,
    /// Samples of a period's heights (.stl, .png).
    #[arg(long, default_value = "256x256", value_parser = super::parse_size)]
    pub samples: [usize; 2],
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Radiance {
    Klems,
    TensorTree,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Edit {
    Geometry,
    Brdf,
    Color,
    Camera,
}

#[derive(Debug, Args)]
pub struct ProfileArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// What is edited; without it everything is computed from nothing.
    #[arg(long)]
    pub edit: Option<Edit>,
    /// From the edit to the picture, which stays on the device where that makes it.
    #[arg(long = "picture", requires = "edit")]
    pub image: bool,
    /// Width and height in pixels of that picture and of that of `--edit camera`.
    #[arg(long, default_value = "384x384", value_parser = super::parse_size)]
    pub size: [usize; 2],
    /// Timed runs after one warm-up; medians are printed.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeat: u32,
}

#[derive(Debug, Args)]
pub struct ReportArgs {
    /// Scene files, or names of shipped materials.
    #[arg(required = true)]
    pub scenes: Vec<String>,
    /// The folder for report.html, report.csv and report.json. A run that was broken off goes on from what is there.
    #[arg(short, long)]
    pub output: PathBuf,
    /// Override any field of each scene: `--set material.default.brdf.roughness=0.3` (repeatable).
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Minutes a scene; presets are always measured.
    #[arg(long, default_value_t = 5.0, value_parser = super::parse_minutes)]
    pub minutes: f64,
    /// Direction pairs that errors are taken over.
    #[arg(long, default_value_t = 500, value_parser = super::parse_count)]
    pub pairs: usize,
    /// Settings with all knobs turned at once.
    #[arg(long, default_value_t = 40)]
    pub combinations: usize,
    /// No progress and no notes on standard error.
    #[arg(long)]
    pub quiet: bool,
}

/// Of commands that keep what took long to make.
#[derive(Debug, Args)]
pub struct KeepingArgs {
    /// Make everything anew, and keep nothing of it (see `biscale cache`).
    #[arg(long)]
    pub no_cache: bool,
}

#[derive(Debug, Args)]
pub struct CacheArgs {
    /// Remove all that was kept.
    #[arg(long)]
    pub clear: bool,
    /// Machine-readable output.
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct MaterialsArgs {
    /// Machine-readable output.
    #[arg(long)]
    pub json: bool,
}
