//! The formats: a line each, which names the file where its row stands. The program's help, the studio's buttons
//! and what Python knows follow from the rows.

use super::row::Row;

macro_rules! formats {
    ($($(#[$about:meta])* $name:ident = $module:ident;)*) => {
        /// A kind of output.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Format {
            $($(#[$about])* $name,)*
        }

        impl Format {
            /// All that any build can write.
            pub const KNOWN: &'static [Self] = &[$(Self::$name),*];

            pub(super) fn row(self) -> &'static Row {
                match self {
                    $(Self::$name => &super::$module::FORMAT,)*
                }
            }
        }
    };
}

formats! {
    /// glTF 2.0, binary: one mesh with a morph target per frame.
    Glb = glb;
    /// USD as text: points as time samples, material, camera.
    Usd = usd;
    /// One OBJ file per frame.
    Obj = obj;
    /// One binary PLY file per frame.
    Ply = ply;
    /// Point cache, with the mesh it belongs to as OBJ.
    Pc2 = pc2;
    /// NumPy archive of motion, faces, uv, camera, forces and parameters, in the camera frame.
    Npz = npz;
    /// Recording for the viewer of rerun: video, camera, mesh and texture over time, in the camera frame. Needs
    /// the cargo feature `rerun`.
    Rrd = recording;
    /// Model of MuJoCo: the sheet as a flex, in the shape of the first frame.
    Mujoco = mujoco;
    /// Material preset of ZOZO's contact solver.
    Ppf = ppf;
    /// U3M 1.1: the maps and the weight for programs of the fashion trade.
    U3m = u3m;
}

impl Format {
    /// All that this build can write, in the order of [`KNOWN`](Self::KNOWN).
    pub fn built() -> impl Iterator<Item = Self> {
        Self::KNOWN.iter().copied().filter(|format| format.row().feature.is_none_or(|(_, built)| built))
    }

    /// What it is called, such as `glb`.
    pub fn key(self) -> &'static str {
        self.row().key
    }

    /// The programs that it is for, or what it is, in a few words.
    pub fn programs(self) -> &'static str {
        self.row().programs
    }

    /// What it holds, in one line.
    pub fn content(self) -> &'static str {
        self.row().content
    }

    /// The cargo feature that it needs, if any.
    pub fn feature(self) -> Option<&'static str> {
        self.row().feature.map(|(name, _)| name)
    }
}

impl std::str::FromStr for Format {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let found = Self::KNOWN.iter().find(|format| format.key() == text.to_ascii_lowercase());
        found.copied().ok_or_else(|| {
            let keys: Vec<_> = Self::KNOWN.iter().map(|format| format.key()).collect();
            format!("the formats are: {}", keys.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_has_a_name_and_files_of_its_own() {
        let mut keys: Vec<_> = Format::KNOWN.iter().map(|format| format.key()).collect();
        let mut ends: Vec<_> =
            Format::KNOWN.iter().flat_map(|format| format.row().files.iter().map(|(end, _)| *end)).collect();
        for (names, count) in [(&mut keys, Format::KNOWN.len()), (&mut ends, 12)] {
            names.sort_unstable();
            names.dedup();
            assert_eq!(names.len(), count, "{names:?}");
        }
        for format in Format::KNOWN {
            let key = format.key();
            assert_eq!(key.to_uppercase().parse(), Ok(*format));
            assert!(key.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit()), "{key}");
            assert!(
                ![format.programs(), format.content()].contains(&"") && !format.row().files.is_empty(),
                "{key}"
            );
        }
        let told = "gbl".parse::<Format>().unwrap_err();
        assert!(Format::KNOWN.iter().all(|format| told.contains(format.key())), "{told}");
    }

    #[test]
    fn a_build_lacks_what_its_features_do_not_bring_and_nothing_else() {
        let built: Vec<_> = Format::built().collect();
        for format in Format::KNOWN {
            let has = format.feature().is_none() || cfg!(feature = "rerun");
            assert_eq!(built.contains(format), has, "{}", format.key());
        }
        assert_eq!(Format::KNOWN.iter().filter(|format| format.feature().is_some()).count(), 1);
    }
}
