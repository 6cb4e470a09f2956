//! Help: the first steps of usual tasks, and every shortcut.

use eframe::egui::{self, Context, Grid, RichText, ScrollArea};

use crate::app::actions;

const TASKS: [(&str, &str); 7] = [
    (
        "Make a blue velvet",
        "Search the gallery for \"velvet\" and click one. In the panel, Materials, turn the colour of \"Default\" to blue, and that of \
         \"Floor\" to a darker one; Surface has the spread, the lean and the number of the fibres.",
    ),
    (
        "Paint a relief",
        "Press P. The first stroke turns any surface into a relief of its shape. Brushes, size and strength are under the tile; \
         [ and ] change the size. The relief is saved beside the scene as an image.",
    ),
    (
        "Paint what it is made of",
        "Press P and choose Material: the first stroke makes \"Paint 1\", which stands under Materials like all others. Colour \
         multiplies what is there. Both lie over any surface and are saved beside the scene.",
    ),
    (
        "Use a measured paint",
        "Drop a MERL .binary or an RGL .bsdf file on the window, or choose \"Measured\" as the BRDF of a material.",
    ),
    (
        "Take it to another renderer",
        "File, Export the material: Format says who reads which. For Mitsuba 3 take RGL (.bsdf); a note beside the file says in \
         words what it holds.",
    ),
    ("Compare two versions", "Press B to keep what you see as A, edit on, and drag the line between A and now."),
    (
        "Look around",
        "Drag turns the object, the middle button moves it, the wheel comes closer, until the tiles \
         themselves show; a double click frames it. Shift-drag or \
         the right button turns the light.",
    ),
];

/// The window; whether it stays open.
pub fn help_ui(ctx: &Context) -> bool {
    let mut open = true;
    egui::Window::new("Help")
        .open(&mut open)
        .default_width(520.0)
        .pivot(egui::Align2::CENTER_CENTER)
        .default_pos(ctx.content_rect().center())
        .collapsible(false)
        .show(ctx, |ui| {
            ScrollArea::vertical().max_height(560.0).min_scrolled_height(460.0).show(ui, |ui| {
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
