//! Settings: each is declared once, with its meaning, default, unit and range, by `settings!`. The struct, its
//! `Default`, the checks, `--set`, `tessuto settings` and `docs/settings.md` follow from the declaration.

use std::ops::RangeInclusive;

use serde_json::Value;

use crate::error::{Error, Result};

/// A setting as users meet it.
#[derive(Debug, Clone, PartialEq)]
pub struct Setting {
    /// Dotted key, such as `texture.size`.
    pub key: String,
    /// What it does.
    pub meaning: String,
    /// What it may be.
    pub values: Values,
}

/// What a setting may be.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Values {
    /// A number in a range.
    Number {
        /// The range, with its ends.
        range: RangeInclusive<f64>,
        /// Unit; empty for pure numbers and counts.
        unit: &'static str,
    },
    /// One of these words.
    Choice(&'static [&'static str]),
    /// Yes or no.
    Flag,
}

impl Values {
    /// The unit; empty where there is none.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Number { unit, .. } => unit,
            Self::Choice(_) | Self::Flag => "",
        }
    }

    fn allow(&self, value: &Value) -> bool {
        match self {
            Self::Number { range, .. } => value.as_f64().is_some_and(|v| range.contains(&v)),
            Self::Choice(words) => value.as_str().is_some_and(|v| words.contains(&v)),
            Self::Flag => value.is_boolean(),
        }
    }
}

impl std::fmt::Display for Values {
    /// The range, or the words, without the unit.
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Number { range, .. } => write!(f, "{} to {}", short(*range.start()), short(*range.end())),
            Self::Choice(words) => f.write_str(&words.join(", ")),
            Self::Flag => f.write_str("true, false"),
        }
    }
}

/// `value` exactly; in powers of ten where it would have many digits.
fn short(value: f64) -> String {
    let [plain, scientific] = [format!("{value}"), format!("{value:e}")];
    if plain.len() > 5 && scientific.len() < plain.len() { scientific } else { plain }
}

impl Setting {
    /// Checks `value`.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the setting, the value and its range.
    pub fn check(&self, value: &Value) -> Result<()> {
        if self.values.allow(value) {
            return Ok(());
        }
        // JSON has no word for numbers that are not finite.
        let found = if value.is_null() { "NaN or infinite".to_owned() } else { text(value) };
        Err(Error::usage(format!("setting {} = {found}", self.key), self.must()))
    }

    fn must(&self) -> String {
        match &self.values {
            Values::Number { range, unit } => {
                let [low, high] = [*range.start(), *range.end()].map(short);
                let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
                format!("it must be a number between {low} and {high}{unit}")
            }
            values => format!("it must be one of: {values}"),
        }
    }
}

/// Checks that one setting is at most another.
///
/// # Errors
/// [`Error::Usage`] naming both.
pub fn ordered(low: &str, a: f64, high: &str, b: f64) -> Result<()> {
    if a <= b {
        return Ok(());
    }
    Err(Error::usage(format!("setting {low} = {a} is above {high} = {b}"), "change either of them"))
}

/// A value as `--set` takes it.
pub fn text(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// A struct of settings.
pub trait Settings {
    /// Its settings, in their order; keys are relative to it.
    fn settings() -> Vec<Setting>;
}

/// What stands below a key: one setting, or those of a struct; keys are relative to it.
pub type Below = Vec<Setting>;

fn one(values: Values) -> Below {
    vec![Setting { key: String::new(), meaning: String::new(), values }]
}

/// A number in `range`.
pub fn number(range: RangeInclusive<f64>, unit: &'static str) -> Below {
    one(Values::Number { range, unit })
}

/// One of `words`.
pub fn choice(words: &'static [&'static str]) -> Below {
    one(Values::Choice(words))
}

/// Yes or no.
pub fn flag() -> Below {
    one(Values::Flag)
}

/// The settings of `S`.
pub fn group<S: Settings>() -> Below {
    S::settings()
}

/// Puts `below` under `key`; what has no meaning of its own takes that of `documentation`.
pub fn under(key: &str, documentation: &[&str], below: Below) -> Vec<Setting> {
    let words = documentation.iter().map(|line| line.trim()).collect::<Vec<_>>().join(" ");
    let meaning = words.trim_end_matches('.').to_owned();
    below
        .into_iter()
        .map(|s| Setting {
            key: if s.key.is_empty() { key.to_owned() } else { format!("{key}.{}", s.key) },
            meaning: if s.meaning.is_empty() { meaning.clone() } else { s.meaning },
            values: s.values,
        })
        .collect()
}

/// Declares a struct of settings. A field is `name: type = default, values;` with a doc comment that says what it does
/// and `values` one of [`number`], [`choice`], [`flag`] and [`group`].
#[macro_export]
macro_rules! settings {
    (
        $(#[$attribute:meta])*
        pub struct $name:ident {
            $($(#[doc = $documentation:literal])+ $field:ident : $type:ty = $default:expr, $values:expr;)+
        }
    ) => {
        $(#[$attribute])*
        #[derive(Debug, Clone, PartialEq, ::serde::Serialize, ::serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        #[non_exhaustive]
        pub struct $name {
            $(
                $(#[doc = $documentation])+
                #[doc = concat!("\n`", stringify!($values), "`, default `", stringify!($default), "`")]
                pub $field: $type,
            )+
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default),+ }
            }
        }

        impl $crate::settings::Settings for $name {
            fn settings() -> Vec<$crate::settings::Setting> {
                #[allow(unused_imports)]
                use $crate::settings::{choice, flag, group, number};
                [$($crate::settings::under(stringify!($field), &[$($documentation),+], $values)),+].concat()
            }
        }
    };
}

pub use settings;

#[cfg(test)]
mod tests {
    use super::*;

    settings! {
        /// An example.
        pub struct Example {
            /// Length of the
            /// thing.
            length: f64 = 2.0, number(0.5..=1e6, "m");
            /// Whether it is there.
            there: bool = true, flag();
            /// How it looks.
            look: String = "red".to_owned(), choice(&["red", "blue"]);
        }
    }

    #[test]
    fn one_declaration_makes_struct_default_and_table() {
        let example = Example::default();
        assert_eq!((example.length, example.there, example.look.as_str()), (2.0, true, "red"));
        let [length, there, look] = <[Setting; 3]>::try_from(Example::settings()).unwrap();
        assert_eq!((length.key.as_str(), length.meaning.as_str()), ("length", "Length of the thing"));
        assert_eq!((length.values.to_string().as_str(), length.values.unit()), ("0.5 to 1e6", "m"));
        assert_eq!(there.values.to_string(), "true, false");
        let refused = |s: &Setting, v: Value| s.check(&v).unwrap_err().to_string();
        assert!(refused(&length, 0.4.into()).contains("between 0.5 and 1e6 m"));
        assert!(refused(&length, f64::NAN.into()).contains("NaN"));
        assert!(refused(&look, "green".into()).contains("red, blue"));
        assert!(refused(&there, 1.into()).contains("true, false"));
        length.check(&2.into()).unwrap();
        look.check(&"blue".into()).unwrap();
    }
}
