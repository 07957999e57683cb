//! How near the hot kernels come to what this machine can do, on one thread:
//! `cargo bench -p tessuto-bench --bench limits`, with `-- --write` into docs/performance.md.
//!
//! Every row has a kernel's *work*, arithmetic operations and bytes that it has to move, its time, and how long that
//! work would take at the rates that loops which do nothing else reach in the same run. The longer of the two is the
//! limit that binds the kernel; the last column is that limit's time by the kernel's.

mod kernels;
mod machine;
mod work;

use std::fmt::Write;

use kernels::{Kernel, Precision};
use machine::Machine;

/// Where `--write` writes, from the package's folder, in which cargo runs benches.
const PAGE: &str = "../../docs/performance.md";

fn main() {
    let is_written = std::env::args().any(|argument| argument == "--write");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a pool of one thread");
    let page = pool.install(|| {
        let mut machine = Machine::default();
        let kernels = kernels::all(&mut machine);
        page(&machine, &kernels)
    });
    println!("{page}");
    if is_written {
        std::fs::write(PAGE, page).expect("docs/performance.md can be written");
    }
}

fn page(machine: &Machine, kernels: &[Kernel]) -> String {
    let mut out = String::from(HEADER);
    let [loops, products] = [machine.loop_rates, machine.product_rates].map(|rates| rates.map(|r| r / 1e9));
    let bytes = [192e6, 1.5e6].map(|size| machine.bytes_per_second(size) / 1e9);
    let _ = writeln!(out, "| rate in this run | double | single precision |\n|---|---|---|");
    let _ = writeln!(out, "| multiplications and additions, GFlop/s | {:.0} | {:.0} |", loops[0], loops[1]);
    let _ = writeln!(out, "| product of dense matrices, GFlop/s | {:.0} | {:.0} |", products[0], products[1]);
    let _ = writeln!(out, "| triad in 192 MB, GB/s | {:.0} | |", bytes[0]);
    let _ = writeln!(out, "| triad in 1.5 MB, GB/s | {:.0} | |\n", bytes[1]);
    let _ = writeln!(out, "| kernel | MFlop | MB | work | time | bound by | of the limit |");
    let _ = writeln!(out, "|---|---|---|---|---|---|---|");
    for k in kernels {
        let by_flops = k.flops / machine.flops_per_second(k.precision);
        let by_bytes = k.bytes / machine.bytes_per_second(k.bytes);
        let bound = if by_flops > by_bytes { "arithmetic" } else { "memory" };
        let _ = writeln!(
            out,
            "| {} | {:.2} | {:.2} | {} | {} | {bound} | {:.0} % |",
            k.name,
            k.flops / 1e6,
            k.bytes / 1e6,
            if k.is_counted { "counted" } else { "estimated" },
            time(k.seconds),
            100.0 * by_flops.max(by_bytes) / k.seconds,
        );
    }
    out.push_str(FOOTER);
    out
}

fn time(seconds: f64) -> String {
    match seconds < 1e-3 {
        true => format!("{:.0} µs", seconds * 1e6),
        false => format!("{:.2} ms", seconds * 1e3),
    }
}

/// Shortest time of a call of `f` in seconds, over several rounds: other programs only make it longer.
pub fn shortest<T>(mut f: impl FnMut() -> T) -> f64 {
    let begun = std::time::Instant::now();
    let mut least = f64::INFINITY;
    let mut calls = 0;
    while calls < 5 || begun.elapsed().as_secs_f64() < 1.0 {
        let start = std::time::Instant::now();
        std::hint::black_box(f());
        least = least.min(start.elapsed().as_secs_f64());
        calls += 1;
    }
    least
}

/// For [`Machine::flops_per_second`]: which rates a kernel could reach.
impl Precision {
    const fn index(self) -> usize {
        match self {
            Self::Double => 0,
            Self::Single => 1,
        }
    }
}

const HEADER: &str = "# How near the kernels are to the machine's limits\n
`cargo bench -p tessuto-bench --bench limits -- --write` measures and writes this page; do not edit it. Everything runs
on one thread. Times are the shortest of many, on whatever machine the page was last made on.

- *MFlop*, *MB*: arithmetic operations of one call, and bytes that it has to read and write at least once from beyond
  the registers. *Counted*: by running the formulas with numbers that count, or by the factor's own sizes. *Estimated*:
  by hand from the formulas, good to a factor of about 1.5; each estimate stands in a comment of
  `crates/tessuto-bench/benches/limits/work.rs`. A step's work is the sum of its parts.
- *Bound by*: which of both takes longer at the rates below. The rate for bytes is that of a triad (a = b + s c) whose
  arrays together are as large as the kernel's bytes, so that kernels whose data fit in a cache are held to the cache.
- The rate for arithmetic is the larger of two: of a loop in registers of 256 bits, which the program is compiled for,
  and of the library's product of two dense matrices, which takes wider ones where the processor has them. Only the
  factor uses that library.
- *Of the limit*: that least time by the measured one. Square roots, divisions and table look-ups count as one
  operation each, though they take longer: kernels that have many cannot reach 100 %.

";

const FOOTER: &str = "
A solved step (implicit Euler) takes as many linear systems as it needs, so that its work is not a formula: its rows are
in `cargo bench -p tessuto-bench --bench sim`. The search's colour term works on images of a running reconstruction and
is not measured here.
";
