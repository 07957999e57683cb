//! The user's browser.

use std::ffi::OsStr;
use std::process::{Command, Stdio};

/// Asks the system to show `address`, a URL or a file; whether it could be asked. Whoever calls prints the address
/// too, so a system without a browser is no fault.
pub fn open(address: impl AsRef<OsStr>) -> bool {
    let program = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else {
        // Without a screen xdg-open would start a browser in the terminal.
        if std::env::var_os("DISPLAY").or_else(|| std::env::var_os("WAYLAND_DISPLAY")).is_none() {
            return false;
        }
        "xdg-open"
    };
    let mut command = Command::new(program);
    command.arg(address).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let child = command.spawn();
    child.map(|mut child| std::thread::spawn(move || child.wait())).is_ok()
}
