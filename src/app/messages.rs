//! Messages over the bottom of the large view. They do not resize the view, so that no image has to be rendered again.
//!
//! Notes disappear by themselves. Errors stay until the user closes them or their cause is gone.

use eframe::egui::{self, Align2, Area, Color32, Context, Frame, Order, Rect, Response, ScrollArea, Ui};

use super::theme;

/// Severity of a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Disappears after the time that reading it takes.
    Note,
    /// First steps and offers; stays until the user closes or answers it.
    Guide,
    /// Stays until the user closes it or its cause is gone.
    Error,
}

#[derive(Debug, Clone, PartialEq)]
struct Message {
    level: Level,
    /// A new message of the same source replaces this one, and a success of the source removes it.
    source: &'static str,
    text: String,
    /// Buttons that answer the message.
    buttons: &'static [&'static str],
    /// Time at which a note disappears [s, interface clock]; absent until the note is visible.
    until: Option<f64>,
}

impl Message {
    /// Time to notice and to read the message [s].
    fn seconds(&self) -> f64 {
        6.0 + self.text.chars().count() as f64 / 15.0
    }
}

/// Time that a note stays after the pointer has left it [s].
const AFTER_HOVER: f64 = 3.0;
const MARGIN: f32 = 8.0;

/// The answer of the user to a message, which is closed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reply {
    pub source: &'static str,
    /// Index of the button; `None` if the user closed the message.
    pub button: Option<usize>,
}

/// The messages of the editor.
#[derive(Debug, Default)]
pub struct Messages {
    list: Vec<Message>,
    /// All messages are visible.
    unfolded: bool,
}

impl Messages {
    pub fn put(&mut self, level: Level, source: &'static str, text: impl Into<String>) {
        self.put_with(level, source, text, &[]);
    }

    /// Puts a message with buttons.
    pub fn put_with(
        &mut self,
        level: Level,
        source: &'static str,
        text: impl Into<String>,
        buttons: &'static [&'static str],
    ) {
        self.clear(source);
        self.list.push(Message { level, source, text: text.into(), buttons, until: None });
    }

    pub fn clear(&mut self, source: &str) {
        self.list.retain(|message| message.source != source);
    }

    /// Texts of all messages but the offer to add what a scene leaves out, which is no complaint.
    #[cfg(test)]
    pub fn texts(&self) -> Vec<&str> {
        let complaints = self.list.iter().filter(|message| message.source != super::left_out::SOURCE);
        complaints.map(|message| message.text.as_str()).collect()
    }

    /// Shows the messages over the bottom of `over`. Returns the answer of the user.
    pub fn ui(&mut self, ctx: &Context, over: Rect) -> Option<Reply> {
        let now = ctx.time();
        self.list.retain(|message| message.until.is_none_or(|until| now < until));
        let (visible, hidden) = self.visible();
        if visible.is_empty() {
            self.unfolded = false;
            return None;
        }
        let mut closed = None;
        let area = Area::new(egui::Id::unique("messages"))
            .order(Order::Middle)
            .pivot(Align2::LEFT_BOTTOM)
            .fixed_pos(over.left_bottom() + egui::vec2(MARGIN, -MARGIN));
        area.show(ctx, |ui| {
            ui.set_width(over.width() - 2.0 * MARGIN);
            ui.spacing_mut().item_spacing.y = 3.0;
            if hidden > 0 || self.unfolded {
                let text = if self.unfolded { "Show fewer messages".to_owned() } else { format!("{hidden} more") };
                if ui.small_button(text).clicked() {
                    self.unfolded = !self.unfolded;
                }
            }
            // Long messages must not cover what lies below the view.
            let height = (over.height() - 2.0 * MARGIN - 30.0).max(30.0);
            ScrollArea::vertical().max_height(height).show(ui, |ui| closed = self.lines_ui(ui, visible, now));
        });
        let (at, button) = closed?;
        let closed = self.list.remove(at);
        self.list.retain(|message| message.text != closed.text);
        Some(Reply { source: closed.source, button })
    }

    /// Draws the lines of messages. Returns the index of the one that the user closed, and that of its button.
    fn lines_ui(&mut self, ui: &mut Ui, visible: Vec<usize>, now: f64) -> Option<(usize, Option<usize>)> {
        let mut closed = None;
        for at in visible {
            let message = &mut self.list[at];
            let (shown, answer) = line(ui, message);
            if let Some(button) = answer {
                closed = Some((at, button));
            }
            if message.level == Level::Note {
                let full = now + message.seconds();
                let until = message.until.get_or_insert(full);
                if shown.contains_pointer() {
                    *until = until.max(now + AFTER_HOVER);
                }
                ui.ctx().request_repaint_after_secs((*until - now) as f32 + 0.05);
            }
        }
        closed
    }

    /// Indices of the visible messages, in the order of arrival, and the number of hidden ones. One message is visible: the
    /// newest error, else the newest note, else the newest of the first steps and offers. A button shows the others.
    fn visible(&self) -> (Vec<usize>, usize) {
        let is_first = |at: &usize| !self.list[..*at].iter().any(|before| before.text == self.list[*at].text);
        // Two workers may report the same error.
        let mut order: Vec<usize> = (0..self.list.len()).filter(is_first).collect();
        let all = order.len();
        if !self.unfolded {
            let rank = |level| match level {
                Level::Error => 0,
                Level::Note => 1,
                Level::Guide => 2,
            };
            order.sort_by_key(|&at| (rank(self.list[at].level), std::cmp::Reverse(at)));
            order.truncate(1);
        }
        let hidden = all - order.len();
        (order, hidden)
    }
}

/// Shows one message. Returns the button by which the user closed it; `None` inside stands for the cross.
fn line(ui: &mut Ui, message: &Message) -> (Response, Option<Option<usize>>) {
    let color = match message.level {
        Level::Note | Level::Guide => theme::ACCENT,
        Level::Error => theme::warning(ui.visuals()),
    };
    let frame = Frame::new()
        .fill(ui.visuals().panel_fill.lerp_to_gamma(color, 0.22))
        .corner_radius(4.0)
        .inner_margin(egui::Margin::symmetric(10, 5));
    let shown = frame.show(ui, |ui| {
        let row = ui.horizontal(|ui| {
            let (dot, _) = ui.allocate_exact_size(egui::Vec2::splat(10.0), egui::Sense::hover());
            ui.painter().circle_filled(dot.center(), 4.0, color);
            let right = egui::Layout::right_to_left(egui::Align::Center);
            let inner = ui.with_layout(right, |ui| {
                let close = ui.add(egui::Button::new("×").fill(Color32::TRANSPARENT)).on_hover_text("Close");
                let mut answer = close.clicked().then_some(None);
                for (at, name) in message.buttons.iter().enumerate().rev() {
                    if ui.button(*name).clicked() {
                        answer = Some(Some(at));
                    }
                }
                ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                    ui.add(egui::Label::new(message.text.as_str()).wrap());
                });
                answer
            });
            inner.inner
        });
        row.inner
    });
    (shown.response, shown.inner)
}

#[cfg(test)]
#[path = "messages_tests.rs"]
mod tests;
