//! What the rows say of the bars that the avatar is held to.

use std::fmt::Write as _;

use super::{
    plan::{Keyframes, Method, Poses, Table},
    rows::Row,
    subject::Task,
};

/// One bar on one person in one outfit.
struct Bar {
    what: String,
    value: f64,
    limit: f64,
    /// Whether the value must not exceed the limit, or must reach it.
    at_most: bool,
}

impl Bar {
    fn holds(&self) -> bool {
        if self.at_most {
            self.value <= self.limit
        } else {
            self.value >= self.limit
        }
    }
}

/// Outfits that fit closely; all others count as loose.
const CLOSE_FITTING: [&str; 4] = [
    "longsleeve_trousers",
    "tshirt_shorts",
    "polo_trousers",
    "tshirt_trousers",
];

/// A table of all bars that the rows can tell of; empty if there are none.
pub(super) fn markdown(rows: &[Row]) -> String {
    let bars = bars(rows);
    if bars.is_empty() {
        return String::new();
    }
    let mut text = "## bars\n\n| bar | value | limit | holds |\n|---|---|---|---|\n".to_owned();
    for bar in &bars {
        let (sign, holds) = (
            if bar.at_most { "<=" } else { ">=" },
            if bar.holds() { "yes" } else { "**no**" },
        );
        let Bar { what, value, limit, .. } = bar;
        let _written = writeln!(
            text,
            "| {what} | {value:.3} | {sign} {limit:.3} | {holds} |"
        );
    }
    text
}

fn bars(rows: &[Row]) -> Vec<Bar> {
    let mut subjects: Vec<(&str, &str)> = Vec::new();
    for row in rows {
        let subject = (row.subject.as_str(), row.outfit.as_str());
        if !subjects.contains(&subject) {
            subjects.push(subject);
        }
    }
    let of = |&(subject, outfit): &(&str, &str)| {
        let rows: Vec<&Row> = rows.iter().filter(|row| row.subject == subject).collect();
        let is_close = CLOSE_FITTING.contains(&outfit.replace('-', "_").as_str());
        of_subject(subject, is_close, &rows)
    };
    subjects.iter().flat_map(of).collect()
}

fn of_subject(subject: &str, is_close: bool, rows: &[&Row]) -> Vec<Bar> {
    let mut bars = Bars { subject, list: Vec::new() };
    let extrapolated = Asked { rows, task: Task::Extrapolation };
    few_shot(&mut bars, &extrapolated, is_close);
    more_and_noisier(&mut bars, &extrapolated);
    if is_close {
        let interpolated = Asked { rows, task: Task::Interpolation };
        let d_f_cm = interpolated.few(Method::Effigy, |row| row.scores.d_f_cm);
        bars.at_most("interpolation, D_f", d_f_cm, Some(0.42));
        let nc = interpolated.few(Method::Effigy, |row| row.scores.nc);
        bars.at_least("interpolation, NC", nc, Some(0.78));
    }
    let observed = |method| {
        let of = |row: &&&Row| row.table == Table::Strangers && row.method == method;
        rows.iter().find(of).and_then(|row| row.scores.observed_mm)
    };
    let limit = times(observed(Method::BareBody), 0.7);
    bars.at_most(
        "observed, 0.7 of the bare body's",
        observed(Method::Effigy),
        limit,
    );
    bars.list
}

fn few_shot(bars: &mut Bars<'_>, asked: &Asked<'_>, is_close: bool) {
    let d_f_cm = |method| asked.few(method, |row| row.scores.d_f_cm);
    let ours = d_f_cm(Method::Effigy);
    let half = times(d_f_cm(Method::BareBody), 0.5);
    bars.at_most("D_f, half the bare body's", ours, half);
    if !is_close {
        let limit = times(d_f_cm(Method::Static), 0.8);
        bars.at_most("D_f, 0.8 of the static surface's", ours, limit);
    }
    let floors = asked.rows.iter().find_map(|row| row.history_floor_cm);
    let reachable = d_f_cm(Method::Oracle).map(|oracle| 1.5 * oracle + floors.unwrap_or(0.0));
    bars.at_most(
        "D_f, 1.5 times the oracle's plus the history floor",
        ours,
        reachable,
    );
    let without = d_f_cm(Method::NoMetaLearning);
    bars.at_least(
        "D_f without meta-learning, 1.3 times ours",
        without,
        times(ours, 1.3),
    );
}

fn more_and_noisier(bars: &mut Bars<'_>, asked: &Asked<'_>) {
    let ours = asked.few(Method::Effigy, |row| row.scores.d_f_cm);
    let d_f_cm = |table: Table, like: &dyn Fn(&Row) -> bool| {
        asked.mean(table, Method::Effigy, like, |row| row.scores.d_f_cm)
    };
    for (sensor, factor) in [("azure", 1.35), ("d435", 2.0)] {
        let seen = d_f_cm(Table::Sensors, &|row| row.sensor == sensor);
        let what = format!("D_f of {sensor}, {factor} times the noiseless");
        bars.at_most(&what, seen, times(ours, factor));
    }
    let share = |data: &str| d_f_cm(Table::Data, &|row| row.data == data);
    let (fifth, all) = (share("20 %"), share("100 %"));
    bars.at_most("D_f of 20 % of the data, that of eight frames", fifth, ours);
    bars.at_most("D_f of all data, that of 20 %", all, fifth);
}

fn times(value: Option<f64>, factor: f64) -> Option<f64> {
    value.map(|value| value * factor)
}

/// One person's bars, as far as there are rows for them.
struct Bars<'a> {
    subject: &'a str,
    list: Vec<Bar>,
}

impl Bars<'_> {
    fn at_most(&mut self, what: &str, value: Option<f64>, limit: Option<f64>) {
        self.push(what, value.zip(limit), true);
    }

    fn at_least(&mut self, what: &str, value: Option<f64>, limit: Option<f64>) {
        self.push(what, value.zip(limit), false);
    }

    fn push(&mut self, what: &str, known: Option<(f64, f64)>, at_most: bool) {
        if let Some((value, limit)) = known {
            let what = format!("{}: {what}", self.subject);
            self.list.push(Bar { what, value, limit, at_most });
        }
    }
}

/// Rows of one person for one task.
struct Asked<'a> {
    rows: &'a [&'a Row],
    task: Task,
}

impl Asked<'_> {
    /// Of eight noiseless frames.
    fn few(&self, method: Method, value: impl Fn(&Row) -> Option<f64>) -> Option<f64> {
        self.mean(Table::FewShot, method, |_| true, value)
    }

    /// Over the seeds, in true poses and of single frames.
    fn mean(
        &self,
        table: Table,
        method: Method,
        like: impl Fn(&Row) -> bool,
        value: impl Fn(&Row) -> Option<f64>,
    ) -> Option<f64> {
        let wanted = |row: &&&Row| {
            (row.table, row.method, row.task) == (table, method, self.task)
                && (row.poses, row.keyframes) == (Poses::True, Keyframes::Single)
                && like(row)
        };
        let values: Vec<f64> = self
            .rows
            .iter()
            .filter(wanted)
            .filter_map(|row| value(row))
            .collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    }
}
