//! What the page shows of a motion's causes.

use glam::DVec3;

use super::{Folder, UNCHANGED, changed};
use crate::report::causes::{CauseData, CauseRow, CauseSpread, ForceArrows, known};
use crate::report::chart::{Chart, Series};
use crate::report::{EmbeddedMotion, embed};
use tessuto_core::error::{Error, Result};
use tessuto_core::mesh::Positions;
use tessuto_estimate::io::{self, npy, zip};
use tessuto_estimate::motion::causes::{Constraint, Found, cut_cloth};
use tessuto_sim::cloth::AREA_DENSITY;
use tessuto_sim::per_width::{PerWidth, bending_length};

/// Vertices with arrows, besides those that are held, at most.
const SITES: usize = 300;
/// Largest forces.npz that is read `[bytes]`.
const MAX_BYTES: u64 = 1 << 30;
/// Forces, in the order of the page: name in forces.npz, and for people. Friction has no arrows.
const FORCES: [(&str, &str); 5] = [
    ("gravity", "gravity"),
    ("air", "air"),
    ("hold", "hold"),
    ("residual", "unexplained"),
    ("friction", "internal friction"),
];

/// Forces per mass [m/s²] of every cause, in the order of [`FORCES`], shape [N − 1, V] each.
pub(super) type Forces = [Vec<Positions>; FORCES.len()];

/// Those in forces.npz of `saved`, where it is.
pub(super) fn forces(saved: &Folder) -> Result<Option<Forces>> {
    let path = saved.path().join("forces.npz");
    if saved.found.is_none() || !path.is_file() {
        return Ok(None);
    }
    let fail = |problem: String| Error::input(path.display().to_string(), problem, UNCHANGED);
    let entries = zip::read(&io::read_bounded(&path, MAX_BYTES)?).map_err(fail)?;
    let shape = [saved.motion()?.len() - 1, saved.mesh.positions.len(), 3];
    let mut out = Forces::default();
    for (field, (name, _)) in out.iter_mut().zip(FORCES) {
        let file = format!("{name}.npy");
        let bytes = entries.iter().find(|(name, _)| *name == file).map(|(_, bytes)| bytes);
        let array = npy::decode(bytes.ok_or_else(|| fail(format!("holds no {file}")))?, false)
            .map_err(|problem| fail(format!("{file} {problem}")))?;
        if array.shape != shape || array.data.iter().any(|v| !v.is_finite()) {
            return Err(fail(format!("{file} has shape {:?}, expected {shape:?}, all finite", array.shape)));
        }
        let frame = |data: &[f64]| data.chunks_exact(3).map(DVec3::from_slice).collect();
        *field = array.data.chunks_exact(3 * shape[1]).map(frame).collect();
    }
    Ok(Some(out))
}

/// What the page shows; `None` of results without causes.
pub(super) fn data(saved: &Folder, forces: Option<&Forces>) -> Result<Option<CauseData>> {
    let Some(found) = &saved.found else { return Ok(None) };
    let mut out = CauseData { rows: rows(saved, found), ..CauseData::default() };
    out.replays = changed::read(saved, saved.motion()?.len())?;
    if let Some(forces) = forces.filter(|forces| !forces[0].is_empty()) {
        let sites = sites(&saved.mesh.positions, &found.held);
        out.sites = embed::base64_of(&sites);
        let at_sites = |x: &Positions| sites.iter().map(|v| x[*v as usize]).collect();
        for (field, (key, label)) in forces.iter().zip(FORCES).take(4) {
            // Gravity is the same in every frame.
            let frames = if key == "gravity" { &field[..1] } else { field };
            let vectors = EmbeddedMotion::new(&frames.iter().map(at_sites).collect::<Vec<_>>());
            out.forces.push(ForceArrows { key, label, vectors });
        }
    }
    Ok(Some(out))
}

/// Up to [`SITES`] vertices far from each other, and the `held` ones, in ascending order.
fn sites(template: &[DVec3], held: &[usize]) -> Vec<u32> {
    let mut chosen: Vec<usize> = held.to_vec();
    if template.len() <= SITES {
        return (0..template.len() as u32).collect();
    }
    // The farthest one from all so far, again and again.
    let mut distance = vec![f64::INFINITY; template.len()];
    let mut next = 0;
    for _ in 0..SITES {
        chosen.push(next);
        let place = template[next];
        distance.iter_mut().zip(template).for_each(|(d, p)| *d = d.min(p.distance_squared(place)));
        next = (0..template.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b])).expect("vertices");
    }
    chosen.sort_unstable();
    chosen.dedup();
    chosen.into_iter().map(|v| v as u32).collect()
}

/// The sizes of the forces in every frame, as parts of their sum over the vertices.
pub(super) fn shares(saved: &Folder, forces: &Forces) -> Option<Chart> {
    let found = saved.found.as_ref()?;
    let masses = cut_cloth(&saved.mesh, &found.rest_lengths).masses;
    let intervals = forces[0].len();
    let sum = |field: &[Positions], n: usize| -> f64 {
        field[n].iter().zip(&masses).map(|(a, m)| a.length() * m).sum()
    };
    let sizes: Vec<[f64; FORCES.len()]> =
        (0..intervals).map(|n| std::array::from_fn(|k| sum(&forces[k], n))).collect();
    let part = |n: usize, k: usize| {
        let size = sizes.get(n.min(intervals.saturating_sub(1)))?;
        let all: f64 = size.iter().sum();
        (all > 0.0).then(|| 100.0 * size[k] / all)
    };
    let first = saved.run.frames[0];
    let line = |(k, (_, label)): (usize, (&str, &str))| Series {
        name: label.to_owned(),
        values: (0..=intervals).map(|n| part(n, k)).collect(),
    };
    Some(Chart {
        title: "Forces as fractions of the sum of their sizes over the vertices".to_owned(),
        x_label: "frame".to_owned(),
        unit: "%".to_owned(),
        by_frame: true,
        log: false,
        stacked: true,
        x: (first..=first + intervals).map(|n| n as f64).collect(),
        series: FORCES.into_iter().enumerate().map(line).collect(),
    })
}

fn rows(saved: &Folder, found: &Found) -> Vec<CauseRow> {
    let (causes, spread, said) = (&found.causes, &found.spread, &found.constraints);
    let row = |label: &str, value: f64, unit: &'static str, sd_of_ln: f64, said: Constraint| CauseRow {
        label: label.to_owned(),
        value,
        unit,
        spread: Some(CauseSpread::Factor(sd_of_ln.exp())),
        constraint: Some(said),
        ..CauseRow::default()
    };
    let stiffness = |label: &str, value: f64, unit: &'static str, k: usize| {
        row(label, value, unit, spread.ln_stiffness[k], said.stiffness[k])
    };
    let plain = |label: &str, value: f64, unit: &'static str| CauseRow {
        label: label.to_owned(),
        value,
        unit,
        ..CauseRow::default()
    };
    let mut rows = saved.per_width.iter().flat_map(|w| of_width(w, &stiffness)).collect::<Vec<_>>();
    let ranges = saved.run.settings.dynamics.ranges();
    let logs = &saved.parameters.log_stiffness;
    for (k, (property, value)) in saved.parameters.properties().enumerate().take(3) {
        let mut row = stiffness(&format!("springs: {}", property.label), value, property.unit, k);
        if let Some(bound) = ranges[k].1.bound_at(logs[k]) {
            row.note = format!("at the {bound} bound of its search");
        }
        rows.push(row);
    }
    let mut density = plain("mass per area", AREA_DENSITY, "kg/m²");
    density.known = Some(known::DENSITY);
    density.note = "assumed: all stiffnesses are in proportion to it".to_owned();
    let mut down =
        plain("gravity, angle to the image's down", causes.down.angle_between(DVec3::Y).to_degrees(), "°");
    down.spread = Some(CauseSpread::Margin(spread.down.to_degrees()));
    down.constraint = Some(said.down);
    let mut held = plain("held vertices", found.held.len() as f64, "");
    held.note = listed(&found.held);
    rows.extend([
        density,
        down,
        row("drag coefficient of the air", causes.drag(), "", spread.ln_drag, said.drag),
        row("internal friction", causes.friction(), "J·s/rad²", spread.ln_friction, said.friction),
        held,
    ]);
    if let Some(sizes) = saved.sizes {
        rows.extend([
            plain("acceleration of the motion, root mean square", sizes.motion, "m/s²"),
            plain("by the cloth's springs", sizes.elastic, "m/s²"),
            plain("by the air", sizes.air, "m/s²"),
            plain("of held vertices by what holds them", sizes.hold, "m/s²"),
            plain("that none of these explains", sizes.residual, "m/s²"),
            plain("that leads exactly to what was found, besides", sizes.correction, "m/s²"),
            plain("distance of the motion without that", 1e3 * sizes.beside, "mm"),
            plain("largest distance of a replay by all forces", 1e3 * sizes.replay, "mm"),
        ]);
    }
    rows
}

/// Stiffnesses whatever the mesh; those of warp and weft follow from one number each.
fn of_width(w: &PerWidth, stiffness: &dyn Fn(&str, f64, &'static str, usize) -> CauseRow) -> Vec<CauseRow> {
    let length = |k: usize| 1e3 * bending_length(w.bending[k], w.area_density);
    let known = |row: CauseRow, range: [f64; 2]| CauseRow { known: Some(range), ..row };
    let third = |mut row: CauseRow| {
        if let Some(CauseSpread::Factor(factor)) = &mut row.spread {
            *factor = factor.cbrt();
        }
        row.constraint = row.constraint.map(|said| said.powered(1.0 / 3.0));
        row
    };
    let mut out = Vec::new();
    for (k, side) in ["warp", "weft"].into_iter().enumerate() {
        let row = stiffness(&format!("bending stiffness, {side}"), w.bending[k], "N·m", 1);
        out.push(known(row, known::BENDING));
    }
    for (k, side) in ["warp", "weft"].into_iter().enumerate() {
        let mut row = third(stiffness(&format!("bending length, {side}"), length(k), "mm", 1));
        row.note = "whatever the mass per area".to_owned();
        out.push(known(row, known::BENDING_LENGTH.map(|l| 1e3 * l)));
    }
    out.push(stiffness("shear stiffness", w.shear, "N/m", 2));
    let mean = (w.membrane[0] * w.membrane[1]).sqrt();
    out.push(stiffness("membrane stiffness, mean of warp and weft", mean, "N/m", 0));
    out
}

/// Numbers, the first few.
fn listed(numbers: &[usize]) -> String {
    const SHOWN: usize = 12;
    let mut words: Vec<String> = numbers.iter().take(SHOWN).map(usize::to_string).collect();
    if numbers.len() > SHOWN {
        words.push("…".to_owned());
    }
    words.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use tessuto_core::mesh::grid;

    #[test]
    fn arrows_stand_all_over_the_sheet_and_where_it_is_held() {
        let mesh = grid(40, 40, glam::DVec2::ONE, 1.0);
        let sites = sites(&mesh.positions, &[7, 1234]);
        assert!(sites.is_sorted() && (SITES..=SITES + 2).contains(&sites.len()));
        assert!(sites.contains(&7) && sites.contains(&1234));
        // No place of the sheet is far from all of them: 300 discs of this radius cover it three times.
        let far = mesh.positions.iter().map(|p| {
            sites.iter().map(|v| p.distance(mesh.positions[*v as usize])).fold(f64::INFINITY, f64::min)
        });
        let far = far.fold(0.0, f64::max);
        assert!(far < 0.06, "{far} m");
        assert_eq!(super::sites(&mesh.positions[..9], &[3]), (0..9).collect::<Vec<u32>>());
    }

    #[test]
    fn long_lists_are_cut() {
        assert_eq!(listed(&[1, 2]), "1, 2");
        assert!(listed(&(0..20).collect::<Vec<_>>()).ends_with("11, …"));
    }
}
