//! The simulation, and its adjoint.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use tessuto::glam::DVec3;
use tessuto::math::factor::Scratch;
use tessuto::mesh::Mesh;
use tessuto::sim::cloth::AngleSpring;
use tessuto::sim::contact::ContactSettings;
use tessuto::sim::state::{StepGradients, StepTape};
use tessuto::sim::step::{step, step_vjp};
use tessuto::sim::{self, Accelerations, Integrator, RolloutInputs, State, StepSettings, Stiffness};

use crate::arrays::{self, field};
use crate::error::IntoPython as _;

/// Masses and springs of a mesh.
#[pyclass(frozen, module = "tessuto._native")]
pub struct Cloth {
    cloth: Arc<sim::Cloth>,
    template: Mesh,
}

type Vertices<'py> = Bound<'py, PyArray2<f64>>;
type Elements<'py> = Bound<'py, PyArray1<f64>>;

#[pymethods]
impl Cloth {
    #[new]
    fn new(py: Python<'_>, vertices: PyReadonlyArray2<'_, f64>, faces: Vec<Vec<u32>>) -> PyResult<Self> {
        let positions = arrays::positions(vertices.as_array())?;
        // The simulation needs no texture coordinates.
        let uvs = vec![Default::default(); positions.len()];
        let corners = |vertices: Vec<u32>| tessuto::mesh::Face { uvs: vertices.clone(), vertices };
        let mesh = Mesh { positions, uvs, faces: faces.into_iter().map(corners).collect() };
        arrays::check_faces(&mesh)?;
        if let Some(k) = mesh.positions.iter().position(|p| !p.is_finite()) {
            return Err(crate::error::refused(format!("vertex {k} is {}", mesh.positions[k])));
        }
        let cloth = py.detach(|| sim::Cloth::new(&mesh));
        if let Some(k) = cloth.masses.iter().position(|m| *m <= 0.0) {
            return Err(crate::error::refused(format!(
                "vertex {k} has no mass: give it a face with an area"
            )));
        }
        Ok(Self { cloth: Arc::new(cloth), template: mesh })
    }

    #[getter]
    fn masses<'py>(&self, py: Python<'py>) -> Elements<'py> {
        PyArray1::from_slice(py, &self.cloth.masses)
    }

    #[getter]
    fn edges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let edges = &self.cloth.edges;
        arrays::shaped(py, edges.iter().flat_map(|edge| edge.vertices).collect(), [edges.len(), 2])
    }

    #[getter]
    fn rest_lengths<'py>(&self, py: Python<'py>) -> Elements<'py> {
        PyArray1::from_iter(py, self.cloth.edges.iter().map(|edge| edge.rest_length))
    }

    #[getter]
    fn bends<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        angles(py, &self.cloth.bends)
    }

    #[getter]
    fn shears<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        angles(py, &self.cloth.shears)
    }
}

impl Cloth {
    /// With contact by these settings, JSON.
    fn touching(&self, contact: Option<&str>) -> PyResult<Arc<sim::Cloth>> {
        let Some(text) = contact else { return Ok(self.cloth.clone()) };
        let settings: ContactSettings =
            serde_json::from_str(text).map_err(|e| crate::error::refused(format!("contact: {e}")))?;
        let cloth = self.cloth.as_ref().clone().with_contact(&self.template, &settings);
        cloth.map(Arc::new).map_err(|e| crate::error::refused(e.to_string()))
    }
}

fn angles<'py>(py: Python<'py>, springs: &[AngleSpring]) -> PyResult<Bound<'py, PyArray2<u32>>> {
    arrays::shaped(py, springs.iter().flat_map(|spring| spring.vertices).collect(), [springs.len(), 3])
}

/// Stiffnesses of every edge, bending pair and shearing pair.
type Stiffnesses<'py> = (PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>, PyReadonlyArray1<'py, f64>);

fn stiffness(cloth: &sim::Cloth, (stretch, bend, shear): &Stiffnesses) -> PyResult<Stiffness> {
    let of = |array: &PyReadonlyArray1<f64>, count: usize, what: &str| {
        let values: Vec<f64> = array.as_array().iter().copied().collect();
        if values.len() != count || values.iter().any(|k| !k.is_finite() || *k < 0.0) {
            let text = format!("{what} is not one finite stiffness, at least 0, for each of {count} springs");
            return Err(crate::error::refused(text));
        }
        Ok(values)
    };
    Ok(Stiffness {
        stretch: of(stretch, cloth.edges.len(), "stretch")?,
        bend: of(bend, cloth.bends.len(), "bend")?,
        shear: of(shear, cloth.shears.len(), "shear")?,
        ..Stiffness::uniform(cloth, [0.0; 3])
    })
}

fn of_springs<'py>(py: Python<'py>, gradients: Stiffness) -> (Elements<'py>, Elements<'py>, Elements<'py>) {
    let Stiffness { stretch, bend, shear, .. } = gradients;
    (PyArray1::from_vec(py, stretch), PyArray1::from_vec(py, bend), PyArray1::from_vec(py, shear))
}

/// Length of a step `[s]`, damping, whether it is linearised, tolerance `[m]`, most iterations.
type Stepping = (f64, f64, bool, f64, usize);

fn settings((step, damping, linearized, tolerance, newton_limit): Stepping) -> PyResult<StepSettings> {
    if !(step.is_finite() && step > 0.0) {
        return Err(crate::error::refused(format!("dt is {step} s, it must be above 0")));
    }
    let integrator = if linearized { Integrator::LinearizedEuler } else { Integrator::ImplicitEuler };
    Ok(StepSettings { integrator, step, damping, tolerance, newton_limit })
}

/// One sub-step, as its adjoint needs it.
#[pyclass(frozen, module = "tessuto._native")]
pub struct ClothStep {
    cloth: Arc<sim::Cloth>,
    settings: StepSettings,
    stiffness: Stiffness,
    tape: StepTape,
}

/// Positions and velocities after one sub-step, and its record.
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "everything that determines a step")]
pub fn cloth_step<'py>(
    py: Python<'py>,
    cloth: &Cloth,
    x: PyReadonlyArray2<'py, f64>,
    v: PyReadonlyArray2<'py, f64>,
    acceleration: PyReadonlyArray2<'py, f64>,
    stiffnesses: Stiffnesses<'py>,
    stepping: Stepping,
    contact: Option<&str>,
) -> PyResult<(Vertices<'py>, Vertices<'py>, ClothStep)> {
    let cloth = cloth.touching(contact)?;
    let count = cloth.vertex_count();
    let before = State { x: field(x.as_array(), count, "x")?, v: field(v.as_array(), count, "v")? };
    let acceleration = field(acceleration.as_array(), count, "acceleration")?;
    let (stiffness, settings) = (stiffness(&cloth, &stiffnesses)?, settings(stepping)?);
    let work = || step(&cloth, &settings, &stiffness, before, &acceleration, &mut Scratch::default());
    let tape = py.detach(work).into_python(py)?;
    let (x, v) = (arrays::to_rows(py, &tape.after.x)?, arrays::to_rows(py, &tape.after.v)?);
    Ok((x, v, ClothStep { cloth, settings, stiffness, tape }))
}

/// Gradients by x, v, acceleration, the stiffnesses of all springs, and the coefficients of friction.
type StepAdjoint<'py> = (
    Vertices<'py>,
    Vertices<'py>,
    Vertices<'py>,
    (Elements<'py>, Elements<'py>, Elements<'py>),
    Elements<'py>,
);

#[pymethods]
impl ClothStep {
    /// The adjoint.
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        grad_x: PyReadonlyArray2<'py, f64>,
        grad_v: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<StepAdjoint<'py>> {
        let count = self.cloth.vertex_count();
        let mut gradients = StepGradients {
            x: field(grad_x.as_array(), count, "grad_x")?,
            v: field(grad_v.as_array(), count, "grad_v")?,
            ..StepGradients::zeros(&self.cloth)
        };
        py.detach(|| {
            let Self { cloth, settings, stiffness, tape } = self;
            step_vjp(cloth, settings, stiffness, tape, &mut gradients, &mut Scratch::default());
        });
        let rows = |field: &[DVec3]| arrays::to_rows(py, field);
        let of_state = (rows(&gradients.x)?, rows(&gradients.v)?, rows(&gradients.acceleration)?);
        let (x, v, acceleration) = of_state;
        let friction = PyArray1::from_vec(py, gradients.friction);
        Ok((x, v, acceleration, of_springs(py, gradients.stiffness), friction))
    }
}

/// A simulated clip, as its adjoint needs it.
#[pyclass(frozen, module = "tessuto._native")]
pub struct Rollout {
    cloth: Arc<sim::Cloth>,
    settings: StepSettings,
    initial: State,
    accelerations: Accelerations,
    stiffness: Stiffness,
    rollout: sim::Rollout,
}

/// The motion [N, V, 3] of a simulation, and its record. `dynamic` is [(N − 1)·parts, V, 3].
#[pyfunction]
#[expect(clippy::too_many_arguments, reason = "everything that determines a motion")]
pub fn rollout<'py>(
    py: Python<'py>,
    cloth: &Cloth,
    x: PyReadonlyArray2<'py, f64>,
    v: PyReadonlyArray2<'py, f64>,
    constant: [f64; 3],
    dynamic: PyReadonlyArray3<'py, f64>,
    parts: usize,
    stiffnesses: Stiffnesses<'py>,
    substeps: usize,
    stepping: Stepping,
    contact: Option<&str>,
) -> PyResult<(Bound<'py, PyArray3<f64>>, Rollout)> {
    let cloth = cloth.touching(contact)?;
    let count = cloth.vertex_count();
    let initial = State { x: field(x.as_array(), count, "x")?, v: field(v.as_array(), count, "v")? };
    let [entries, vertices, _] = *dynamic.as_array().shape() else { unreachable!("three axes") };
    if vertices != count || parts == 0 || substeps == 0 || entries % parts != 0 || parts > substeps {
        return Err(crate::error::refused(format!(
            "dynamic has {entries} entries of {vertices} vertices, in {parts} parts of {substeps} sub-steps per \
             frame: expected (N - 1)*parts entries of {count} vertices, and at most as many parts as sub-steps"
        )));
    }
    let dynamic = arrays::frames(dynamic.as_array())?;
    let accelerations =
        Accelerations { constant: constant.into(), dynamic, entries_per_frame: parts, wind: None };
    let (stiffness, settings) = (stiffness(&cloth, &stiffnesses)?, settings(stepping)?);
    let work = || {
        let inputs =
            RolloutInputs { initial: &initial, accelerations: &accelerations, stiffness: &stiffness };
        sim::rollout(&cloth, &settings, substeps, entries / parts + 1, &inputs)
    };
    let rollout = py.detach(work).into_python(py)?;
    let motion = arrays::to_frames(py, &rollout.frames, count)?;
    Ok((motion, Rollout { cloth, settings, initial, accelerations, stiffness, rollout }))
}

/// Gradients by x, v, constant and dynamic accelerations, the stiffnesses of all springs, and the coefficients of
/// friction.
type RolloutAdjoint<'py> = (
    Vertices<'py>,
    Vertices<'py>,
    [f64; 3],
    Bound<'py, PyArray3<f64>>,
    (Elements<'py>, Elements<'py>, Elements<'py>),
    Elements<'py>,
);

#[pymethods]
impl Rollout {
    /// The adjoint, for the gradient of every frame's positions.
    fn vjp<'py>(
        &self,
        py: Python<'py>,
        grad_motion: PyReadonlyArray3<'py, f64>,
    ) -> PyResult<RolloutAdjoint<'py>> {
        let count = self.cloth.vertex_count();
        let (found, expected) = (grad_motion.as_array(), [self.rollout.frames.len(), count, 3]);
        if found.shape() != expected {
            let text = format!("grad_motion has shape {:?}, expected {expected:?}", found.shape());
            return Err(crate::error::refused(text));
        }
        let grad_frames = arrays::frames(found)?;
        let gradients = py.detach(|| {
            let Self { cloth, settings, initial, accelerations, stiffness, rollout } = self;
            sim::rollout_vjp(
                cloth,
                settings,
                &RolloutInputs { initial, accelerations, stiffness },
                rollout,
                &grad_frames,
            )
        });
        Ok((
            arrays::to_rows(py, &gradients.initial.x)?,
            arrays::to_rows(py, &gradients.initial.v)?,
            gradients.constant.to_array(),
            arrays::to_frames(py, &gradients.dynamic, count)?,
            of_springs(py, gradients.stiffness),
            PyArray1::from_vec(py, gradients.friction),
        ))
    }
}
