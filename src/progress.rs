//! A bar with time left, on a terminal; a line now and then elsewhere.

use std::io::IsTerminal as _;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// How often a line is printed where no bar can be drawn, as a share of the whole.
const LINES: u64 = 10;

/// Of so many calls while something is waited for, one prints a line.
const WAITS_A_LINE: u64 = 25;

pub(crate) struct Progress {
    bar: ProgressBar,
    /// Print a line each time this many steps are done; no terminal, no bar.
    line_every: Option<u64>,
    waits: u64,
}

impl Progress {
    pub(crate) fn new(what: &'static str, total: Option<u64>) -> Self {
        let terminal = std::io::stderr().is_terminal();
        let bar = match total {
            Some(total) => ProgressBar::new(total).with_style(style(
                "{prefix:>12} [{bar:32}] {pos}/{len}  {eta} left  {wide_msg}",
            )),
            None => ProgressBar::no_length()
                .with_style(style("{prefix:>12} {spinner} {pos}  {wide_msg}")),
        };
        if !terminal {
            bar.set_draw_target(ProgressDrawTarget::hidden());
        }
        bar.set_prefix(what);
        let line_every = (!terminal).then(|| total.map_or(300, |total| (total / LINES).max(1)));
        Self { bar, line_every, waits: 0 }
    }

    pub(crate) fn advance(&self, done: u64) {
        self.bar.set_position(done);
        if self
            .line_every
            .is_some_and(|every| done.is_multiple_of(every))
        {
            let total = self
                .bar
                .length()
                .map_or_else(|| "?".to_owned(), |total| total.to_string());
            eprintln!(
                "{} {done}/{total}, {:.0} s left  {}",
                self.bar.prefix(),
                self.bar.eta().as_secs_f32(),
                self.bar.message()
            );
        }
    }

    /// What is going on, beside the bar.
    pub(crate) fn say(&self, message: impl Into<String>) {
        self.bar.set_message(message.into());
    }

    /// All steps are done and something else is waited for.
    pub(crate) fn waiting(&mut self, message: String) {
        if self.line_every.is_some() && self.waits.is_multiple_of(WAITS_A_LINE) {
            eprintln!("{message}");
        }
        self.waits += 1;
        self.say(message);
    }

    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn style(template: &str) -> ProgressStyle {
    ProgressStyle::with_template(template).expect("the template is a constant that parses")
}
