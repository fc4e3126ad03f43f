//! Runs that are paced by the clock.

use crate::cli::interrupt;
use crate::cosim::Recorder;
use crate::cosim::recorder::Signal;
use pilotage_text::number::significant;
use serde_json::{Value, json};
use std::io;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

/// Upper ends of the classes of delays \[s\]; one more class has those above.
const CLASSES: [f64; 5] = [1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Longest sleep until Ctrl-C is asked for.
const LONGEST: Duration = Duration::from_millis(50);

/// How long before its time a point is waited for without sleep.
const SPUN: Duration = Duration::from_micros(200);

/// Points that were late.
#[derive(Debug, Clone, PartialEq)]
pub struct Deadlines {
    /// Simulated time in a second.
    factor: f64,
    count: u64,
    missed: u64,
    /// Largest delay \[s\].
    worst: f64,
    classes: [u64; CLASSES.len() + 1],
    /// How long after its time a point that was waited for begins: sum and largest \[s\].
    waked: [f64; 2],
}

impl Deadlines {
    fn new(factor: f64) -> Self {
        Self {
            factor,
            count: 0,
            missed: 0,
            worst: 0.0,
            classes: [0; CLASSES.len() + 1],
            waked: [0.0; 2],
        }
    }

    /// A point that is reached so much after its time, or before \[s\].
    fn reached(&mut self, late: f64) {
        self.count += 1;
        if late > 0.0 {
            self.missed += 1;
            self.worst = self.worst.max(late);
            self.classes[CLASSES.partition_point(|end| *end < late)] += 1;
        }
    }

    /// A point that was waited for, and begins so much after its time \[s\].
    fn waked(&mut self, late: f64) {
        let late = late.max(0.0);
        self.waked = [self.waked[0] + late, self.waked[1].max(late)];
    }

    /// Mean delay of points that were waited for \[s\].
    fn mean_wake(&self) -> f64 {
        self.waked[0] / (self.count - self.missed).max(1) as f64
    }

    /// One line.
    pub fn words(&self) -> String {
        let mut text = format!(
            "real time, {} s in a second: {} of {} deadlines missed",
            self.factor, self.missed, self.count
        );
        if self.missed > 0 {
            let worst = significant(1e3 * self.worst, 3);
            let ends = CLASSES.iter().map(|end| format!("up to {} ms", 1e3 * end));
            let ends = ends.chain(["more".to_owned()]).zip(self.classes);
            let classes = ends.filter(|(_, count)| *count > 0);
            let classes: Vec<String> = classes
                .map(|(end, count)| format!("{count} by {end}"))
                .collect();
            text += &format!(", by {worst} ms at most ({})", classes.join(", "));
        }
        if self.count > self.missed {
            let [mean, worst] =
                [self.mean_wake(), self.waked[1]].map(|own| significant(1e3 * own, 2));
            text += &format!("; the others begin {mean} ms after their time, {worst} ms at most");
        }
        text
    }

    pub fn to_json(&self) -> Value {
        let ends = CLASSES.iter().map(|end| json!(end)).chain([Value::Null]);
        let classes = ends.zip(self.classes);
        let classes: Value = classes
            .map(|(end, count)| json!({ "upTo": end, "count": count }))
            .collect();
        json!({
            "factor": self.factor,
            "deadlines": self.count,
            "missed": self.missed,
            "worst": self.worst,
            "delays": classes,
            "wakeMean": self.mean_wake(),
            "wakeWorst": self.waked[1],
        })
    }
}

/// A recorder that waits at each communication point until its time has come; the first row is at once.
pub struct Pace<'r> {
    inner: &'r mut dyn Recorder,
    pub deadlines: Option<Deadlines>,
    begun: Option<(Instant, f64)>,
}

impl<'r> Pace<'r> {
    /// `factor`: simulated time in a second; `None` for a run that does not wait.
    pub fn new(inner: &'r mut dyn Recorder, factor: Option<f64>) -> Self {
        Self {
            inner,
            deadlines: factor.map(Deadlines::new),
            begun: None,
        }
    }
}

impl Recorder for Pace<'_> {
    fn begin(&mut self, signals: &[Signal]) -> io::Result<()> {
        self.inner.begin(signals)
    }

    fn row(&mut self, time: f64, values: &[f64]) -> io::Result<()> {
        if let Some(deadlines) = &mut self.deadlines {
            match self.begun {
                None => self.begun = Some((Instant::now(), time)),
                Some((begun, first)) => {
                    let due = (time - first) / deadlines.factor;
                    let late = begun.elapsed().as_secs_f64() - due;
                    deadlines.reached(late);
                    if late <= 0.0 {
                        wait_until(begun, due);
                        deadlines.waked(begun.elapsed().as_secs_f64() - due);
                    }
                }
            }
        }
        self.inner.row(time, values)
    }

    fn end_rows(&mut self) -> io::Result<()> {
        self.inner.end_rows()
    }

    fn is_stop_asked(&mut self) -> bool {
        self.inner.is_stop_asked()
    }
}

/// Sleeps until so many seconds after `begun`, or until Ctrl-C.
fn wait_until(begun: Instant, due: f64) {
    let is_asked = interrupt::flag();
    while !is_asked.load(Ordering::Relaxed) {
        let left = due - begun.elapsed().as_secs_f64();
        match Duration::try_from_secs_f64(left) {
            // The system wakes a thread some 0.1 ms late.
            Ok(left) if left > SPUN => std::thread::sleep((left - SPUN).min(LONGEST)),
            Ok(left) if !left.is_zero() => std::hint::spin_loop(),
            // Too long for the computer's clock.
            Err(_) if left > 0.0 => std::thread::sleep(LONGEST),
            _ => return,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn delays_are_counted_by_size() {
        let mut own = Deadlines::new(2.0);
        for late in [-0.1, 0.0, 5e-5, 2e-3, 3e-3, 7.0] {
            own.reached(late);
        }
        own.waked(1e-5);
        own.waked(3e-5);
        assert_eq!(
            own.words(),
            "real time, 2 s in a second: 4 of 6 deadlines missed, by 7000 ms at most (1 by up to 0.1 ms, 2 by up to 10 ms, 1 by more); \
             the others begin 0.020 ms after their time, 0.030 ms at most"
        );
        assert_eq!(
            own.to_json()["delays"][2],
            json!({ "upTo": 0.01, "count": 2 })
        );
        assert_eq!(
            own.to_json()["delays"][5],
            json!({ "upTo": null, "count": 1 })
        );
    }
}
