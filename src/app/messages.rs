//! What went wrong and what to do, over the foot of the large view. Nothing moves when one comes or goes, so that no picture
//! has to be made anew; notes go by themselves, troubles stay until they are closed or mended.

use eframe::egui::{self, Align2, Area, Color32, Context, Frame, Order, Rect, Response, Ui};

use super::theme;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Goes once there was time to read it.
    Note,
    /// First steps: stays until it is closed.
    Guide,
    Trouble,
}

#[derive(Debug, Clone, PartialEq)]
struct Message {
    level: Level,
    /// A message of the same source replaces it; when the source is well again it goes.
    source: &'static str,
    text: String,
    /// When it goes by itself [s, the interface's clock]; it starts when it is first seen.
    until: Option<f64>,
}

impl Message {
    /// What it takes to notice and to read it.
    fn seconds(&self) -> f64 {
        6.0 + self.text.chars().count() as f64 / 15.0
    }
}

/// Messages that are seen at once; the others wait behind a button.
const MAX_SEEN: usize = 3;
/// A note under the pointer is being read: it stays this long after the pointer has gone [s].
const LINGERS: f64 = 3.0;
const MARGIN: f32 = 8.0;

/// All that is to be read.
#[derive(Debug, Default)]
pub struct Messages {
    list: Vec<Message>,
    /// All are seen.
    unfolded: bool,
}

impl Messages {
    pub fn put(&mut self, level: Level, source: &'static str, text: impl Into<String>) {
        self.clear(source);
        self.list.push(Message { level, source, text: text.into(), until: None });
    }

    pub fn clear(&mut self, source: &str) {
        self.list.retain(|message| message.source != source);
    }

    #[cfg(test)]
    pub fn texts(&self) -> Vec<&str> {
        self.list.iter().map(|message| message.text.as_str()).collect()
    }

    /// Shows them over the foot of `over`; the source of one that was closed.
    pub fn ui(&mut self, ctx: &Context, over: Rect) -> Option<&'static str> {
        let now = ctx.time();
        self.list.retain(|message| message.until.is_none_or(|until| now < until));
        let (seen, hidden) = self.seen();
        if seen.is_empty() {
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
            for at in seen {
                let message = &mut self.list[at];
                let (shown, close) = line(ui, message);
                if close {
                    closed = Some(at);
                }
                if message.level == Level::Note {
                    let full = now + message.seconds();
                    let until = message.until.get_or_insert(full);
                    if shown.contains_pointer() {
                        *until = until.max(now + LINGERS);
                    }
                    ctx.request_repaint_after_secs((*until - now) as f32 + 0.05);
                }
            }
        });
        let closed = closed.map(|at| self.list.remove(at))?;
        self.list.retain(|message| message.text != closed.text);
        Some(closed.source)
    }

    /// Which are seen, in the order they came, and how many wait behind them: troubles and the newest go first.
    fn seen(&self) -> (Vec<usize>, usize) {
        let is_first = |at: &usize| !self.list[..*at].iter().any(|before| before.text == self.list[*at].text);
        // Two workers may complain of one thing.
        let mut order: Vec<usize> = (0..self.list.len()).filter(is_first).collect();
        let all = order.len();
        if !self.unfolded && all > MAX_SEEN {
            order.sort_by_key(|&at| (self.list[at].level != Level::Trouble, std::cmp::Reverse(at)));
            order.truncate(MAX_SEEN);
            order.sort_unstable();
        }
        let hidden = all - order.len();
        (order, hidden)
    }
}

/// One message, and whether it was closed.
fn line(ui: &mut Ui, message: &Message) -> (Response, bool) {
    let color = match message.level {
        Level::Note | Level::Guide => theme::ACCENT,
        Level::Trouble => theme::WARNING,
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
                ui.with_layout(egui::Layout::left_to_right(egui::Align::Center), |ui| {
                    ui.add(egui::Label::new(message.text.as_str()).wrap());
                });
                close.clicked()
            });
            inner.inner
        });
        row.inner
    });
    (shown.response, shown.inner)
}

#[cfg(test)]
mod tests {
    use eframe::egui::ViewportId;
    use egui_kittest::Harness;
    use egui_kittest::kittest::Queryable;

    use super::*;

    fn harness() -> Harness<'static, Messages> {
        Harness::builder().with_size([600.0, 400.0]).build_ui_state(
            |ui, messages: &mut Messages| {
                let over = ui.max_rect();
                messages.ui(ui.ctx(), over);
            },
            Messages::default(),
        )
    }

    #[test]
    fn notes_go_once_they_could_be_read_and_troubles_and_first_steps_stay() {
        let mut harness = harness();
        harness.state_mut().put(Level::Note, "a", "Wrote a file.");
        harness.state_mut().put(Level::Trouble, "b", "Not saved.");
        harness.state_mut().put(Level::Guide, "c", "First steps.");
        harness.run_steps(4);
        assert_eq!(harness.state().texts().len(), 3);
        // Nothing is painted until the note is to go.
        let delay = harness.output().viewport_output[&ViewportId::ROOT].repaint_delay.as_secs_f64();
        assert!((1.0..10.0).contains(&delay), "{delay}");
        // A quarter of a second each.
        harness.run_steps(40);
        assert_eq!(harness.state().texts(), ["Not saved.", "First steps."]);
        let delay = harness.output().viewport_output[&ViewportId::ROOT].repaint_delay.as_secs_f64();
        assert!(delay > 1e6, "at rest nothing is painted again: {delay}");
    }

    #[test]
    fn a_note_under_the_pointer_is_being_read_and_stays() {
        let mut harness = harness();
        harness.state_mut().put(Level::Note, "a", "Wrote a file.");
        harness.run_steps(3);
        harness.get_by_label("Wrote a file.").hover();
        harness.run_steps(60);
        assert_eq!(harness.state().texts(), ["Wrote a file."]);
        harness.event(egui::Event::PointerGone);
        harness.run_steps(20);
        assert!(harness.state().texts().is_empty());
    }

    #[test]
    fn many_messages_are_few_lines_with_the_troubles_first_and_the_rest_behind_a_button() {
        let mut harness = harness();
        for (source, text) in [("a", "one"), ("b", "two"), ("c", "three"), ("d", "four"), ("e", "one")] {
            let level = if source == "a" { Level::Trouble } else { Level::Note };
            harness.state_mut().put(level, source, text);
        }
        harness.run_steps(3);
        let seen = |harness: &Harness<'_, Messages>| {
            ["one", "two", "three", "four"].map(|text| harness.query_all_by_label(text).count())
        };
        assert_eq!(seen(&harness), [1, 0, 1, 1]);
        harness.get_by_label("1 more").click();
        harness.run_steps(3);
        assert_eq!(seen(&harness), [1, 1, 1, 1]);
        harness.get_by_label("Show fewer messages").click();
        harness.run_steps(3);
        assert_eq!(seen(&harness), [1, 0, 1, 1]);
    }
}
