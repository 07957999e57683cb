//! The fabric as one isotropic shell, and the same numbers in the terms of other programs.
//!
//! Most programs simulate a shell of Young's modulus Y, Poisson's ratio ν and thickness t, with per width
//!
//!   E = Y t/(1 − ν²),   G = Y t/(2 (1 + ν)),   D = Y t³/(12 (1 − ν²)).
//!
//! A fabric has no such t: its threads bend by themselves. E and D together give the one of the shell that stretches
//! and bends as the fabric does, t = √(12 D/E), with Y = E (1 − ν²)/t. ν = 0 here, as threads that are pulled do not
//! narrow the sheet in this program's simulations. G = E/2 follows, far more than woven fabrics have: that is lost,
//! and so is the difference between warp and weft, whose geometric means stand for both.

use serde::Serialize;

use tessuto_sim::per_width::PerWidth;

/// Thickness `[m]` that is written where a program asks for one that only makes masses and contacts.
pub const THICKNESS: f64 = 5e-4;

/// Scale of the bending of ZOZO's solver [m⁴/s²], `BEND_SCALE` in its `shell_bend_stiffness.kernel.cpp`.
const PPF_BEND: f64 = 1.28e-5;

/// D of PhysX over its `bendingStiffness` t³. A hinge of edge e between areas A₀ and A₁ has 3 e²/(2 (A₀ + A₁)) of it,
/// and the sheet whose D it is e²/(A₀ + A₁) of D, in triangles of squares and of equal sides.
const PHYSX_BEND: f64 = 1.5;

/// A sheet without directions, per width.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shell {
    /// E [N/m], the geometric mean of warp and weft.
    pub membrane: f64,
    /// G [N/m].
    pub shear: f64,
    /// D [N·m], the geometric mean of warp and weft.
    pub bending: f64,
    /// ρ [kg/m²].
    pub area_density: f64,
}

impl Shell {
    /// That of a fabric.
    pub fn of(widths: &PerWidth) -> Self {
        let mean = |[warp, weft]: [f64; 2]| (warp * weft).sqrt();
        Self {
            membrane: mean(widths.membrane),
            shear: widths.shear,
            bending: mean(widths.bending),
            area_density: widths.area_density,
        }
    }

    /// t `[m]` of the shell of Poisson's ratio 0 that stretches and bends alike.
    pub fn thickness(&self) -> f64 {
        (12.0 * self.bending / self.membrane).sqrt()
    }

    /// Its Young's modulus Y `[Pa]`.
    pub fn young(&self) -> f64 {
        self.membrane / self.thickness()
    }
}

/// What ZOZO's contact solver takes for a shell of its model `BARAFF_WITKIN`, whose stiffnesses are divided by the
/// area density.
///
/// Per area it has ½ μ ρ of each squared strain along the threads, ½ λ ρ of the squared shear and nothing between
/// the threads, with μ = Y/(2 (1 + ν)) and λ = Y ν/((1 + ν)(1 − 2 ν)): E = μ ρ, G = λ ρ. Both are carried by
/// ν = r/(2 (1 + r)), r = G/E, and Y = 2 (1 + ν) E/ρ.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ppf {
    /// Y, over the density [m²/s²].
    pub young: f64,
    /// ν.
    pub poisson: f64,
    /// Bending of the softer direction, and what warp and weft have beyond it: D/(ρ · 1.28·10⁻⁵ m⁴/s²).
    pub bend: [f64; 3],
}

impl Ppf {
    /// That of a fabric.
    pub fn of(widths: &PerWidth) -> Self {
        let [warp, weft] = widths.bending.map(|d| d / (PPF_BEND * widths.area_density));
        let both = warp.min(weft);
        let shell = Shell::of(widths);
        let poisson = shell.shear / (2.0 * (shell.membrane + shell.shear));
        let young = 2.0 * (1.0 + poisson) * shell.membrane / shell.area_density;
        Self { young, poisson, bend: [both, warp - both, weft - both] }
    }
}

/// A number in another program.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Term {
    /// The program.
    pub program: &'static str,
    /// What it calls the number.
    pub name: &'static str,
    /// The number.
    pub value: f64,
    /// Its unit; empty if it has none.
    pub unit: &'static str,
    /// What it is of the stiffnesses per width.
    pub formula: &'static str,
}

/// The numbers of a fabric in other programs' terms, program by program.
pub fn terms(widths: &PerWidth) -> Vec<Term> {
    let shell = Shell::of(widths);
    let (t, young, ppf) = (shell.thickness(), shell.young(), Ppf::of(widths));
    let rho = widths.area_density;
    let term = |program, name, value, unit, formula| Term { program, name, value, unit, formula };
    const USD: &str = "USD, Newton";
    const OMNI: &str = "Omniverse, PhysX";
    vec![
        term(USD, "physics:surfaceStretchStiffness", shell.membrane, "N/m", "E"),
        term(USD, "physics:surfaceShearStiffness", shell.shear, "N/m", "G"),
        term(USD, "physics:surfaceBendStiffness", shell.bending, "N·m", "D"),
        term(USD, "physics:thicknesses", THICKNESS, "m", "h, assumed"),
        term(USD, "physics:density", rho / THICKNESS, "kg/m³", "ρ/h"),
        term("MuJoCo", "young", young, "Pa", "E/t"),
        term("MuJoCo", "poisson", 0.0, "", "0"),
        term("MuJoCo", "thickness", t, "m", "t = √(12 D/E)"),
        term(OMNI, "youngsModulus", young, "Pa", "E/t"),
        term(OMNI, "poissonsRatio", 0.0, "", "0"),
        term(OMNI, "surfaceThickness", t, "m", "t"),
        term(OMNI, "surfaceBendStiffness", shell.bending / (PHYSX_BEND * t.powi(3)), "Pa", "D/(1.5 t³)"),
        term(OMNI, "density", rho / t, "kg/m³", "ρ/t"),
        term("ZOZO's solver", "shell_young_modulus", ppf.young, "m²/s²", "2 (1 + ν) E/ρ"),
        term("ZOZO's solver", "shell_poisson_ratio", ppf.poisson, "", "ν = G/(2 (E + G))"),
        term("ZOZO's solver", "bend", ppf.bend[0], "", "D/(1.28·10⁻⁵ ρ), the smaller"),
        term("ZOZO's solver", "bend_warp", ppf.bend[1], "", "what the warp has beyond"),
        term("ZOZO's solver", "bend_weft", ppf.bend[2], "", "what the weft has beyond"),
        term("ZOZO's solver", "shell_density", rho, "kg/m²", "ρ"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTHS: PerWidth = PerWidth {
        bending: [1e-6, 4e-6],
        shear: 2.5,
        membrane: [100.0, 400.0],
        bent: 0.1,
        area_density: 0.2,
    };

    #[test]
    fn the_shell_stretches_and_bends_as_the_fabric() {
        let shell = Shell::of(&WIDTHS);
        let (y, t) = (shell.young(), shell.thickness());
        assert!((y * t / 200.0 - 1.0).abs() < 1e-12 && (y * t.powi(3) / 12.0 / 2e-6 - 1.0).abs() < 1e-12);
        // 0.35 mm, as fabrics of such numbers are: nothing is off by a power of ten.
        assert!((t / 3.464e-4 - 1.0).abs() < 1e-3, "{t}");
    }

    #[test]
    fn every_program_bends_a_cylinder_alike() {
        let of = |program: &str, name: &str| {
            let all = terms(&WIDTHS);
            all.iter().find(|t| t.program.contains(program) && t.name == name).expect(name).value
        };
        let d = 2e-6;
        let mujoco = of("MuJoCo", "young") * of("MuJoCo", "thickness").powi(3) / 12.0;
        // A square grid of side a: each hinge across has the energy ½ k (κ a)², and there is one a cell.
        let physx = 1.5 * of("PhysX", "surfaceBendStiffness") * of("PhysX", "surfaceThickness").powi(3);
        let usd = of("USD", "physics:surfaceBendStiffness");
        for found in [mujoco, physx, usd] {
            assert!((found / d - 1.0).abs() < 1e-12, "{found}");
        }
        let along = |k: &str| 1.28e-5 * 0.2 * (of("ZOZO", "bend") + of("ZOZO", k));
        for (found, expected) in [along("bend_warp"), along("bend_weft")].into_iter().zip(WIDTHS.bending) {
            assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
        }
        let (y, nu) = (of("ZOZO", "shell_young_modulus"), of("ZOZO", "shell_poisson_ratio"));
        let (mu, lambda) = (y / (2.0 * (1.0 + nu)), y * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)));
        assert!((mu * 0.2 / 200.0 - 1.0).abs() < 1e-12 && (lambda * 0.2 / 2.5 - 1.0).abs() < 1e-12);
        // Each makes the area density of its own thickness.
        for (program, h, density) in
            [("USD", "physics:thicknesses", "physics:density"), ("PhysX", "surfaceThickness", "density")]
        {
            assert!((of(program, h) * of(program, density) / 0.2 - 1.0).abs() < 1e-12, "{program}");
        }
    }
}
