//! Whether this processor has the instructions that this build uses; without them it would end with an illegal
//! instruction.
//!
//! Whatever is compiled here may use those instructions itself, also to copy two words. What runs before and after
//! a failed check must therefore be next to nothing: constant messages, no formatting.
//! `tools/check_old_processor.sh` runs the program on an emulated processor of 2006.

/// What a build can be set to use.
struct Instructions {
    /// For the user who lacks it.
    message: &'static str,
    register: Register,
    bit: u32,
    /// By this build.
    used: bool,
}

/// Where `cpuid` reports it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Register {
    /// Leaf 1, ECX.
    Basic,
    /// Leaf 7, EBX.
    Extended,
    /// Leaf 0x8000_0001, ECX.
    Amd,
}

macro_rules! instructions {
    ($name:literal, $feature:tt, $register:ident, $bit:literal) => {
        Instructions {
            message: concat!(
                "this build of tessuto needs a processor with AVX2 (Intel and AMD since 2013 to 2015); this one lacks ",
                $name,
                "\n  hint: take another machine, or build tessuto on this one without .cargo/config.toml"
            ),
            register: Register::$register,
            bit: $bit,
            used: cfg!(target_feature = $feature),
        }
    };
}

/// All of x86-64-v3, the best known first: the first that is missing is named.
const INSTRUCTIONS: [Instructions; 15] = [
    instructions!("AVX2", "avx2", Extended, 5),
    instructions!("FMA", "fma", Basic, 12),
    instructions!("BMI1", "bmi1", Extended, 3),
    instructions!("BMI2", "bmi2", Extended, 8),
    instructions!("AVX", "avx", Basic, 28),
    instructions!("AVX: the operating system or virtual machine has not switched it on", "avx", Basic, 27),
    instructions!("F16C", "f16c", Basic, 29),
    instructions!("LZCNT", "lzcnt", Amd, 5),
    instructions!("MOVBE", "movbe", Basic, 22),
    instructions!("POPCNT", "popcnt", Basic, 23),
    instructions!("SSE4.2", "sse4.2", Basic, 20),
    instructions!("SSE4.1", "sse4.1", Basic, 19),
    instructions!("SSSE3", "ssse3", Basic, 9),
    instructions!("SSE3", "sse3", Basic, 0),
    instructions!("CMPXCHG16B", "cmpxchg16b", Basic, 13),
];

/// The message about the first of `INSTRUCTIONS` that is used but not among these bits.
fn missing(basic: u32, extended: u32, amd: u32) -> Option<&'static str> {
    for needed in &INSTRUCTIONS {
        let bits = match needed.register {
            Register::Basic => basic,
            Register::Extended => extended,
            Register::Amd => amd,
        };
        if needed.used && bits >> needed.bit & 1 == 0 {
            return Some(needed.message);
        }
    }
    None
}

/// Whether this build runs on this processor: call it before anything else.
///
/// # Errors
///
/// What the processor lacks and the way out, ready to be shown. On other architectures, and in builds for any
/// x86-64, nothing is ever missing.
#[inline(never)]
pub fn check() -> Result<(), &'static str> {
    #[cfg(target_arch = "x86_64")]
    {
        // `is_x86_feature_detected!` will not do: it is constantly true for what the build may use.
        use std::arch::x86_64::{__cpuid, __cpuid_count};
        let leaf = |present: bool, leaf: u32| if present { Some(__cpuid_count(leaf, 0)) } else { None };
        let basic = __cpuid(1).ecx;
        let extended = leaf(__cpuid(0).eax >= 7, 7).map_or(0, |registers| registers.ebx);
        let amd =
            leaf(__cpuid(0x8000_0000).eax > 0x8000_0000, 0x8000_0001).map_or(0, |registers| registers.ecx);
        if let Some(message) = missing(basic, extended, amd) {
            return Err(message);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_machine_that_runs_this_has_all_and_others_are_refused() {
        assert_eq!(check(), Ok(()));
        assert_eq!(missing(!0, !0, !0), None);
        for needed in INSTRUCTIONS.iter().filter(|needed| needed.used) {
            let without = |register| if register == needed.register { !(1 << needed.bit) } else { !0 };
            let [basic, extended, amd] = [Register::Basic, Register::Extended, Register::Amd].map(without);
            assert_eq!(missing(basic, extended, amd), Some(needed.message));
        }
    }

    /// The build that is delivered uses AVX2, and a processor that has nothing is refused.
    #[test]
    fn the_message_names_what_is_missing_and_the_way_out() {
        if cfg!(target_feature = "avx2") {
            let message = missing(0, 0, 0).unwrap();
            assert!(message.contains("lacks AVX2\n  hint: take another machine"), "{message}");
        } else {
            assert_eq!(missing(0, 0, 0), None);
        }
    }
}
