//! Whether this processor has the instructions that the program was built for: without this it would end with "illegal
//! instruction" somewhere.

use std::arch::x86_64::__cpuid_count;

/// Instructions of x86-64-v3 that this build may use: name, leaf and register of `cpuid` (2 is ecx, 1 is ebx), bit.
/// Intel 64 and IA-32 Architectures Software Developer's Manual, volume 2, CPUID.
const NEEDED: [(&str, u32, usize, u32); 9] = [
    ("FMA", 1, 2, 12),
    ("MOVBE", 1, 2, 22),
    ("OSXSAVE", 1, 2, 27),
    ("AVX", 1, 2, 28),
    ("F16C", 1, 2, 29),
    ("BMI1", 7, 1, 3),
    ("AVX2", 7, 1, 5),
    ("BMI2", 7, 1, 8),
    ("LZCNT", 0x8000_0001, 2, 5),
];

/// What to tell where instructions are missing.
#[inline(never)]
pub fn complaint() -> Option<String> {
    let missing = missing(|leaf| {
        // A processor that does not know a leaf answers with another's bits.
        if __cpuid_count(leaf & 0x8000_0000, 0).eax < leaf {
            return [0; 4];
        }
        let found = __cpuid_count(leaf, 0);
        [found.eax, found.ebx, found.ecx, found.edx]
    });
    (!missing.is_empty()).then(|| {
        format!(
            "error: this build of tessuto needs a processor with AVX2 (x86-64-v3, most since 2013); this one lacks {}\n  \
             hint: build it on this machine without the file .cargo/config.toml",
            missing.join(", ")
        )
    })
}

fn missing(cpuid: impl Fn(u32) -> [u32; 4]) -> Vec<&'static str> {
    let lacks = |(_, leaf, register, bit): &&(&str, u32, usize, u32)| cpuid(*leaf)[*register] >> bit & 1 == 0;
    NEEDED.iter().filter(lacks).map(|(name, ..)| *name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_instructions_are_named() {
        // The tests themselves are built for these instructions.
        assert_eq!(complaint(), None);
        assert!(missing(|_| [u32::MAX; 4]).is_empty());
        // An Ivy Bridge of 2012 has AVX and F16C only.
        let ivy_bridge = |leaf| if leaf == 1 { [0, 0, 1 << 27 | 1 << 28 | 1 << 29, 0] } else { [0; 4] };
        assert_eq!(missing(ivy_bridge), ["FMA", "MOVBE", "BMI1", "AVX2", "BMI2", "LZCNT"]);
    }
}
