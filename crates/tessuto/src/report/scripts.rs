//! Scripts of the page, in its order.

use std::io::Read;
use std::sync::LazyLock;

use flate2::read::ZlibDecoder;

/// Libraries of others, which `build.rs` has packed.
static LIBRARIES: LazyLock<[String; 2]> = LazyLock::new(|| {
    [
        unpacked(include_bytes!(concat!(env!("OUT_DIR"), "/three.min.js"))),
        unpacked(include_bytes!(concat!(env!("OUT_DIR"), "/uPlot.min.js"))),
    ]
});

const OWN: [&str; 11] = [
    include_str!("../../assets/report/data.js"),
    include_str!("../../assets/report/player.js"),
    include_str!("../../assets/report/colours.js"),
    include_str!("../../assets/report/cloth.js"),
    include_str!("../../assets/report/arrows.js"),
    include_str!("../../assets/report/wipe.js"),
    include_str!("../../assets/report/states.js"),
    include_str!("../../assets/report/charts.js"),
    include_str!("../../assets/report/causes.js"),
    include_str!("../../assets/report/main.js"),
    include_str!("../../assets/report/live.js"),
];

/// The script of pages of several cameras, or of one that moves; it comes after the others.
pub(super) const CAMERAS: &str = include_str!("../../assets/report/cameras.js");

/// Those that every page has.
pub(super) fn common() -> impl Iterator<Item = &'static str> {
    LIBRARIES.iter().map(String::as_str).chain(OWN)
}

fn unpacked(packed: &[u8]) -> String {
    let mut text = String::new();
    ZlibDecoder::new(packed).read_to_string(&mut text).expect("packed by this crate's build.rs");
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn libraries_come_out_as_they_went_in() {
        let files = [
            include_str!("../../assets/vendor/three.min.js"),
            include_str!("../../assets/vendor/uPlot.min.js"),
        ];
        assert!(LIBRARIES.iter().eq(files), "bytes of {:?}", LIBRARIES.iter().map(String::len));
    }
}
