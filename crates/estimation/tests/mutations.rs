//! Random mutations of the example problems: whatever stands in a file, reading, posing and fitting it end, and none
//! panics.

use pilotage_estimation::{Posed, ProblemFile, fit, part};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

/// Mutations of all files together.
const MUTATIONS: usize = 10_000;

/// Of each problem one mutation of so many is fitted, if it can be.
const FIT_EVERY: usize = 10;

/// What is put in the place of a number or a word.
const WORDS: [&str; 28] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-308",
    "nan",
    "inf",
    "-inf",
    "1e999",
    "0x7fffffffffffffff",
    "999999999999999999999",
    "true",
    "\"\"",
    "\"free\"",
    "\"steady\"",
    "\"first sample\"",
    "[]",
    "{}",
    "[[run]]",
    "\"1/0\"",
    "\"log(-1)\"",
    "\"(((((((\"",
    "\"µ→\u{1F600}\"",
    "\u{0}",
    "= =",
    "#",
    "\"time\"",
    "{ per = \"run\" }",
];

/// The problems of the examples, with their paths.
fn problems() -> Vec<(PathBuf, String)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/problems");
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)
        .expect("the examples")
        .map(|entry| entry.expect("an entry").path().join("problem.toml"))
        .filter(|path| path.exists())
        .collect();
    paths.sort();
    let read = |path: PathBuf| {
        let text = std::fs::read_to_string(&path).expect("a problem");
        (path, text)
    };
    paths.into_iter().map(read).collect()
}

struct Mutation {
    random: ChaCha8Rng,
}

impl Mutation {
    fn below(&mut self, end: usize) -> usize {
        (self.random.next_u64() % end.max(1) as u64) as usize
    }

    /// The text with one or two changes; comments are left out before, since nothing reads them.
    fn of(&mut self, text: &str) -> String {
        let lines = text
            .lines()
            .map(|line| line.split(" #").next().unwrap_or(line));
        let lines: Vec<&str> = lines.filter(|line| !line.starts_with('#')).collect();
        let mut text = lines.join("\n");
        for _ in 0..1 + self.below(2) {
            text = match self.below(5) {
                0 => self.bytes(&text),
                1 => self.lines(&text),
                _ => self.tokens(&text),
            };
        }
        text
    }

    /// A byte that is another, left out or doubled.
    fn bytes(&mut self, text: &str) -> String {
        let mut bytes = text.as_bytes().to_vec();
        let at = self.below(bytes.len().saturating_sub(1));
        match self.below(3) {
            0 => bytes[at] = self.below(256) as u8,
            1 => drop(bytes.remove(at)),
            _ => bytes.insert(at, bytes[at]),
        }
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// A line that is left out, doubled, or exchanged with another.
    fn lines(&mut self, text: &str) -> String {
        let mut lines: Vec<&str> = text.lines().collect();
        let [at, other] = [self.below(lines.len()), self.below(lines.len())];
        match self.below(3) {
            0 => drop(lines.remove(at)),
            1 => lines.insert(other, lines[at]),
            _ => lines.swap(at, other),
        }
        lines.join("\n")
    }

    /// A word or number that is another one of the file, or one of those that try it most.
    fn tokens(&mut self, text: &str) -> String {
        let is_word = |c: char| c.is_alphanumeric() || "_.-\"".contains(c);
        let mut tokens: Vec<String> = Vec::new();
        for c in text.chars() {
            match tokens
                .last_mut()
                .filter(|last| is_word(c) && last.ends_with(is_word))
            {
                Some(last) => last.push(c),
                None => tokens.push(c.to_string()),
            }
        }
        let words: Vec<usize> = (0..tokens.len())
            .filter(|k| tokens[*k].starts_with(is_word))
            .collect();
        let numbers: Vec<usize> = words
            .iter()
            .copied()
            .filter(|k| tokens[*k].parse::<f64>().is_ok())
            .collect();
        let among = if self.below(2) == 0 && !numbers.is_empty() {
            &numbers
        } else {
            &words
        };
        let at = among[self.below(among.len())];
        tokens[at] = match self.below(8) {
            0 => tokens[words[self.below(words.len())]].clone(),
            1 => "x".repeat(1 << self.below(18)),
            _ => WORDS[self.below(WORDS.len())].to_owned(),
        };
        tokens.concat()
    }
}

#[test]
fn mutations_of_problems_neither_panic_nor_hang() {
    let problems = problems();
    let random = ChaCha8Rng::seed_from_u64(7);
    let mut mutation = Mutation { random };
    let mutated = (0..MUTATIONS).map(|k| {
        let (path, text) = &problems[k % problems.len()];
        (
            path,
            mutation.of(text),
            (k / problems.len()).is_multiple_of(FIT_EVERY),
        )
    });
    let mutated: Vec<(&PathBuf, String, bool)> = mutated.collect();
    let of_one = |(path, text, is_fitted): &(&PathBuf, String, bool)| {
        let mut file = ProblemFile::parse(text, path).ok()?;
        file.options.starts = Some(1);
        file.options.max_iterations = 3;
        let problem = Posed::new(&file, &part::open).ok()?;
        if *is_fitted {
            // At most 12 refinements follow the first solve.
            let found = fit(&problem, &mut |_| ControlFlow::Continue(()));
            assert!(found.iterations <= 3 * 13, "{} of {text}", found.iterations);
        }
        Some(*is_fitted)
    };
    let posed: Vec<bool> = mutated.par_iter().filter_map(of_one).collect();
    let fitted = posed.iter().filter(|is_fitted| **is_fitted).count();
    assert!(
        posed.len() >= 500 && fitted >= 50,
        "{} posed, {fitted} fitted",
        posed.len()
    );
}
