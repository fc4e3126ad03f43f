//! Mutated descriptions and archives: some of each here, and as many as wanted by `cargo bench --bench fuzz`.

use crate::mutation::{self, Depth, Mutator};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use std::collections::BTreeMap;

/// How many inputs came how far.
type Depths = BTreeMap<Depth, u32>;

#[test]
fn the_kept_corpus_is_usable() {
    let corpus = mutation::corpus();
    assert!(corpus.len() >= 4);
    for (name, bytes) in corpus {
        assert_eq!(mutation::try_description(&bytes), Depth::Usable, "{name}");
    }
}

#[test]
fn mutated_descriptions_do_not_panic() {
    let corpus = mutation::corpus();
    let mut mutator = Mutator(ChaCha8Rng::seed_from_u64(1));
    let mut depths = Depths::new();
    for k in 0..400 {
        let (_, bytes) = &corpus[k % corpus.len()];
        let (_, other) = &corpus[(k / 7) % corpus.len()];
        let mut bytes = bytes.clone();
        mutator.mutate(&mut bytes, other);
        *depths.entry(mutation::try_description(&bytes)).or_default() += 1;
    }
    // The mutations are of use only if they reach all depths.
    assert!(
        depths.values().all(|&n| n > 10) && depths.len() == 3,
        "{depths:?}"
    );
}

#[test]
fn mutated_archives_do_not_panic_or_write_outside() {
    let folder = tempfile::tempdir().unwrap();
    let corpus = mutation::corpus();
    let mut mutator = Mutator(ChaCha8Rng::seed_from_u64(2));
    let mut depths = Depths::new();
    for k in 0..300 {
        let (_, bytes) = &corpus[k % corpus.len()];
        let mut bytes = mutation::archive_of(bytes);
        match k % 3 {
            0 => mutator.mutate(&mut bytes, b"PK\x03\x04"),
            _ => mutator.mutate_archive(&mut bytes),
        }
        *depths
            .entry(mutation::try_archive(&bytes, folder.path()))
            .or_default() += 1;
    }
    assert!(
        depths.values().all(|&n| n > 10) && depths.len() == 3,
        "{depths:?}"
    );
}
