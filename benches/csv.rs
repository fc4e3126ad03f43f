//! Cost of reading tables: flights as in `fit`, and tables as in `cosim --input`. Run with `cargo bench --bench csv`;
//! the largest table takes 300 MB on the disk.

use pilotage::cosim::Source;
use pilotage::flights::Trial;
use pilotage::series::Series;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::time::Instant;

/// Rows of a flight; 180,000 are half an hour at 100 Hz.
const FLIGHTS: [u32; 3] = [11_250, 45_000, 180_000];
/// Rows of a table.
const TABLES: [u32; 3] = [100_000, 1_000_000, 10_000_000];

fn main() -> io::Result<()> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("rows.csv");
    // The peak never decreases: the smallest comes first.
    println!("file         rows        MB   seconds   ns a row   peak of the process [MB]");
    for rows in FLIGHTS {
        write(&path, "target [m],position [m],stick [1]", rows)?;
        measure("flight", rows, &path, |path| {
            let trial = Trial::read(path).expect("it is a trial");
            assert_eq!(trial.position.len(), rows as usize);
        })?;
    }
    for rows in TABLES {
        write(&path, "a.u [m],b.u [m]", rows)?;
        measure("table", rows, &path, |path| {
            let series = Series::read_table(path).expect("it is a table");
            assert_eq!(series.time.len(), rows as usize);
            Source::new(series).expect("it feeds");
        })?;
    }
    Ok(())
}

/// A file whose signals have as many digits as measured ones.
fn write(path: &Path, columns: &str, rows: u32) -> io::Result<()> {
    let mut file = BufWriter::new(File::create(path)?);
    writeln!(file, "time [s],{columns}")?;
    let signals = columns.split(',').count();
    for row in 0..rows {
        let time = f64::from(row) * 0.01;
        write!(file, "{time:.2}")?;
        for signal in 0..signals {
            write!(file, ",{:.6}", (time + signal as f64).sin())?;
        }
        writeln!(file)?;
    }
    file.flush()
}

fn measure(what: &str, rows: u32, path: &Path, read: impl FnOnce(&Path)) -> io::Result<()> {
    let size = std::fs::metadata(path)?.len() as f64 / 1e6;
    let begin = Instant::now();
    read(path);
    let seconds = begin.elapsed().as_secs_f64();
    println!(
        "{what:<8} {rows:>8} {size:>9.1} {seconds:>9.3} {:>10.0}   {}",
        1e9 * seconds / f64::from(rows),
        peak_memory().map_or("-".into(), |peak| format!("{peak:.0}"))
    );
    Ok(())
}

/// Peak memory of the process [MB], if the system reports it.
fn peak_memory() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"))?;
    let kilobytes: f64 = line.trim().trim_end_matches(" kB").parse().ok()?;
    Some(kilobytes / 1e3)
}
