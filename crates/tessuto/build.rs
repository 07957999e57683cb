//! Packs the libraries that pages embed: half a megabyte of the program less.

use std::io::Write;
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::ZlibEncoder;

fn main() {
    let folder = PathBuf::from("assets/vendor");
    let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("set by cargo"));
    for name in ["three.min.js", "uPlot.min.js"] {
        println!("cargo::rerun-if-changed={}", folder.join(name).display());
        pack(&folder.join(name), &out.join(name));
    }
}

fn pack(from: &Path, to: &Path) {
    let mut packed = ZlibEncoder::new(Vec::new(), Compression::best());
    packed.write_all(&std::fs::read(from).expect("a file of this crate")).expect("memory takes every byte");
    std::fs::write(to, packed.finish().expect("memory takes every byte")).expect("the build's own folder");
}
