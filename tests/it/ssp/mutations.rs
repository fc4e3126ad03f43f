//! Mutations of all files of a system: whatever they become, nothing panics, and mistakes name a file.

use super::parts::{AFTER, MAP, NESTED, SIGNALS, values};
use super::{ssd, write};
use crate::command::Folder;
use crate::mutation::Mutator;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// Puts values of attributes in the place of others, which leaves the file well-formed.
fn exchange(bytes: &mut Vec<u8>, random: &mut ChaCha8Rng) {
    let text = String::from_utf8(bytes.clone()).unwrap();
    let (head, rest) = text.split_at(text.rfind("xmlns:ss").unwrap());
    let mut parts: Vec<&str> = rest.split('"').collect();
    let values = parts.len() / 2;
    let mut any = || 2 * (random.next_u64() % values as u64) as usize + 1;
    for _ in 0..2 {
        let (from, to) = (any(), any());
        parts[to] = parts[from];
    }
    *bytes = format!("{head}{}", parts.join("\"")).into_bytes();
}

#[test]
fn two_thousand_mutations_do_not_panic() {
    let folder = Folder::new();
    let (text, values) = (ssd("1.0", NESTED, AFTER), values());
    let files = [
        ("SystemStructure.ssd", text.as_str()),
        ("resources/signals.ssb", SIGNALS),
        ("resources/map.ssm", MAP),
        ("resources/deep er/all.ssv", &values),
    ];
    write(&folder, "s", &files);
    let path = folder.path("s");
    let mut mutator = Mutator(ChaCha8Rng::seed_from_u64(48));
    let (mut read, mut refused) = (0, 0);
    for k in 0..2000 {
        let (name, good) = files[if k % 2 == 0 { 0 } else { 1 + k / 2 % 3 }];
        let mut bytes = good.as_bytes().to_vec();
        match k % 4 < 2 {
            true => mutator.mutate(&mut bytes, text.as_bytes()),
            false => exchange(&mut bytes, &mut mutator.0),
        }
        folder.write(&format!("s/{name}"), &bytes);
        match pilotage_systems::read(&path, None) {
            Ok(ssp) => {
                read += 1;
                ssp.description
                    .to_toml(&path)
                    .unwrap_or_else(|error| error.to_string());
            }
            Err(error) => {
                refused += 1;
                let words = error.to_string();
                assert!(words.contains("/s/"), "{words}");
            }
        }
        folder.write(&format!("s/{name}"), good);
    }
    assert!(
        read > 200 && refused > 200,
        "{read} read, {refused} refused"
    );
}
