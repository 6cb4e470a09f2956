//! The help window: first steps of common tasks, and all shortcuts.

use eframe::egui::{self, Context, Grid, RichText, ScrollArea};

use super::within;
use crate::app::actions;

const TASKS: [(&str, &str); 16] = [
    (
        "Make a blue velvet",
        "Search the gallery for \"velvet\" and click a scene. Under Materials, set the colour of \"Default\" to \
         blue and that of \"Floor\" to a darker blue. Under Surface, change the fibres: \
         spread, lean and number.",
    ),
    (
        "Paint a relief",
        "Press P. The first stroke turns any surface into a height field of its shape. Brushes, size and \
         strength are below the tile, and [ and ] change the size. Saving the scene \
         writes the heights beside it as an image.",
    ),
    (
        "Paint materials and colours",
        "Press P and choose Material. The first stroke creates the material \"Paint 1\", which appears under \
         Materials. Colour multiplies the material below it. Both work on any surface and are saved beside the scene.",
    ),
    (
        "Colour by height, slope or noise",
        "Unfold Colour map and tick its box. Choose a preset map, or edit the stops on the bar: drag them, double-click \
         to add one, press Delete to remove the selected one. Driver is the value that decides the colour. The grey \
         histogram shows how often each value occurs. Press I and point at the object: the orange line shows the values \
         that are visible and lit there.",
    ),
    (
        "See through frosted glass",
        "Search the gallery for \"slab\" and click a scene, or unfold Slab and tick its box. Top and Bottom are the two \
         faces: smooth, rough, or a tile. Drag Distance, or drag in the view with Ctrl, to move the background away, which blurs it. Below the tile, drag \
         the light on the disc: the curves show the transmitted light by each method, and photons as the reference.",
    ),
    (
        "See how far off the result is",
        "The strip at the foot states accuracy and time once the image rests. Press Measure there, or F6 for the chart of \
         PSNR against time, which also compares with a reference.",
    ),
    (
        "Make it faster or finer",
        "Press Measure at the foot. Faster and Finer then show what other settings cost; a click takes them. In the chart \
         (F6), a click on a point takes its settings.",
    ),
    (
        "Reach an accuracy or keep a time",
        "Press F6 and type a PSNR into At least, or milliseconds into At most, and press Enter. The search runs in the \
         background. Use gives the scene the settings that it found; Copy as command copies a command that repeats them.",
    ),
    (
        "See what is simulated and what is left out",
        "If light is missing that may matter, the strip at the foot says so: click \"left out\" and then Add. Effects (F6) \
         gives the reason for each effect, and forces it on or off. Measure each times every effect on and off.",
    ),
    (
        "Look into photographs of a sheet",
        "Choose File, Open a capture folder, and its rig.toml. Pick a pixel of the photograph: the monitor shows the light of \
         each dot there, and below it stand a slice of the data with its model, and the slopes of the faces.",
    ),
    (
        "Compare with the reference",
        "For a slab or a colour map, press M. The view shows three methods beside each other; drag the lines between them. \
         The reference is added up while you look, and states its standard error.",
    ),
    (
        "Use a measured BRDF",
        "Drop a MERL .binary or an RGL .bsdf file on the window, or choose \"Measured\" as the BRDF of a material.",
    ),
    (
        "Use the material in another renderer",
        "Choose File, Export the material. Format lists the programs that read each format. For Mitsuba 3, choose \
         RGL (.bsdf). A text file beside it describes the conventions.",
    ),
    (
        "Look for other forms of a material",
        "Press V. Nine variants differ from the material by up to 20 %; a click takes one.",
    ),
    (
        "Compare two versions",
        "Press B to store the current image as A, and continue editing. Drag the line between A and the current image.",
    ),
    (
        "Look around",
        "Drag to turn the object, and drag with the middle button to move it. Scroll to zoom, until single tiles are \
         visible. Double-click to frame the object. Shift-drag or drag with the right button to turn the light.",
    ),
];

/// Draws the window. Returns whether it stays open.
pub fn help_ui(ctx: &Context) -> bool {
    let mut open = true;
    egui::Window::new("Help")
        .open(&mut open)
        .default_width(520.0)
        .pivot(egui::Align2::CENTER_CENTER)
        .default_pos(ctx.content_rect().center())
        .collapsible(false)
        .show(ctx, |ui| {
            let [most, least] = [560.0, 460.0].map(|height| within(ctx, height, 90.0, 1));
            ScrollArea::vertical().max_height(most).min_scrolled_height(least).show(ui, |ui| {
                for (task, steps) in TASKS {
                    ui.label(RichText::new(task).strong());
                    ui.label(steps);
                    ui.add_space(6.0);
                }
                ui.separator();
                ui.label(RichText::new("Shortcuts").strong());
                Grid::new("shortcuts").num_columns(2).striped(true).spacing([24.0, 4.0]).show(ui, |ui| {
                    for entry in actions::ENTRIES {
                        if let Some(keys) = &entry.keys {
                            ui.label(entry.name);
                            ui.monospace(ctx.format_shortcut(keys));
                            ui.end_row();
                        }
                    }
                });
            });
        });
    open && !ctx.input(|input| input.key_pressed(egui::Key::Escape))
}
