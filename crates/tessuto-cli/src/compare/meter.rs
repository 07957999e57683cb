//! Memory and energy, as the system reports them.

/// Where the processors' counters of energy are.
const POWERCAP: &str = "/sys/class/powercap";

/// The most that process `id` has held so far `[bytes]`, on Linux.
pub fn held(id: u32) -> Option<u64> {
    let status = std::fs::read_to_string(format!("/proc/{id}/status")).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()? * 1024)
}

/// What the counters of all processors say `[J]`; `None` where there are none or they may not be read.
pub fn joules() -> Option<f64> {
    let packages = std::fs::read_dir(POWERCAP).ok()?.flatten().filter(|entry| {
        // intel-rapl:0, not its parts intel-rapl:0:1.
        let name = entry.file_name().to_string_lossy().into_owned();
        name.contains("rapl") && name.matches(':').count() == 1
    });
    let of = |entry: std::fs::DirEntry| -> Option<f64> {
        let text = std::fs::read_to_string(entry.path().join("energy_uj")).ok()?;
        Some(text.trim().parse::<f64>().ok()? * 1e-6)
    };
    let values: Vec<f64> = packages.map(of).collect::<Option<_>>()?;
    (!values.is_empty()).then(|| values.iter().sum())
}
