//! Points in memory: numpy arrays in, numpy arrays out.

use std::{ops::ControlFlow, sync::atomic::Ordering};

use lloydar::{Options, Resampled, resample_with_progress};
use numpy::{
    Element, IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2,
    ndarray::{ArrayView2, Axis},
};
use pyo3::{prelude::*, types::PyDict};

use crate::{
    failure::Failure,
    task::{Product, Task},
};

/// Points that are copied between two looks at signals.
const COPIED_AT_ONCE: usize = 4 << 20;

/// An array of shape (n, 3).
#[derive(FromPyObject)]
pub(crate) enum Points<'py> {
    Double(PyReadonlyArray2<'py, f64>),
    Single(PyReadonlyArray2<'py, f32>),
}

/// Starts to resample `points`. `options` are the keywords of `lloydar.resample` that are given.
#[pyfunction]
#[pyo3(signature = (points, options, *, threads=None))]
pub(crate) fn resample(
    py: Python<'_>,
    points: Points<'_>,
    options: &Bound<'_, PyDict>,
    threads: Option<usize>,
) -> PyResult<Task> {
    let options = options_of(options)?;
    let points = match points {
        Points::Double(points) => copied(py, points.as_array())?,
        Points::Single(points) => copied(py, points.as_array())?,
    };
    Ok(Task::start(threads, move |shared| {
        let progress = |share: f64| {
            shared.reports.reach(share);
            match shared.cancel.load(Ordering::Relaxed) {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        };
        // The library takes the points over without a copy.
        let resampled = resample_with_progress(points, &options, &progress);
        let resampled = resampled.map_err(Failure::Resample)?;
        Ok(Product::Cloud(Box::new(resampled)))
    })?)
}

/// Copies points, whatever their strides, with the interpreter's lock released.
fn copied<T: Element + Copy + Into<f64>>(
    py: Python<'_>,
    points: ArrayView2<'_, T>,
) -> PyResult<Vec<[f64; 3]>> {
    let mut copied = Vec::with_capacity(points.nrows());
    for part in points.axis_chunks_iter(Axis(0), COPIED_AT_ONCE) {
        py.check_signals()?;
        py.detach(|| {
            let (x, y, z) = (part.column(0), part.column(1), part.column(2));
            let rows = x.iter().zip(y).zip(z);
            copied.extend(rows.map(|((&x, &y), &z)| [x.into(), y.into(), z.into()]));
        });
    }
    Ok(copied)
}

/// Reads the options of a cloud in memory. Ranges are checked by the library.
fn options_of(given: &Bound<'_, PyDict>) -> PyResult<Options> {
    let mut densities = Vec::new();
    for (name, value) in given {
        match name.extract::<String>()?.as_str() {
            "spacing" => densities.push(Options::with_spacing(value.extract()?)),
            "count" => densities.push(Options::with_count(value.extract()?)),
            "ratio" => densities.push(Options::with_ratio(value.extract()?)),
            _ => {}
        }
    }
    let [mut options] = <[Options; 1]>::try_from(densities).map_err(|densities| {
        let remedy = "give one of spacing, count and ratio";
        Failure::option("density", format!("({} given)", densities.len()), remedy)
    })?;
    for (name, value) in given {
        options = match name.extract::<String>()?.as_str() {
            "exact" => options.exact(),
            "iterations" => options.iterations(value.extract()?),
            "accelerate" => options.acceleration(by_name("accelerate", &value)?),
            "seeds" => options.seeds(by_name("seeds", &value)?),
            "patch" => options.patch(by_name("patch", &value)?),
            "smooth" => options.smooth(value.extract()?),
            "fill" => options.fill(value.extract()?),
            "restrict" => options.restrict(value.extract()?),
            "seed" => options.seed(value.extract()?),
            "scale" => options.scale(value.extract()?),
            _ => options,
        };
    }
    Ok(options)
}

/// Reads a choice by the name that it has on the command line.
fn by_name<T: serde::de::DeserializeOwned>(
    option: &'static str,
    name: &Bound<'_, PyAny>,
) -> PyResult<T> {
    let name: String = name.extract()?;
    let choice = serde_json::from_value(name.clone().into());
    Ok(choice.map_err(|error| Failure::option(option, name, error.to_string()))?)
}

/// The neighbours of each output point.
#[pyclass(frozen, module = "lloydar._lloydar")]
pub(crate) struct Rings(Resampled);

#[pymethods]
impl Rings {
    /// Returns the neighbours of the output point `index`, and whether they bound its cell all around.
    /// `index` must be below the number of points.
    fn of<'py>(&self, py: Python<'py>, index: usize) -> (Bound<'py, PyArray1<u32>>, bool) {
        let ring = self.0.ring(index);
        (PyArray1::from_slice(py, ring.neighbors), ring.is_closed)
    }

    /// Returns the triangles between the output points, of shape (t, 3), by their `points` and `normals`, which Python
    /// owns.
    fn triangles<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArray2<'py, f64>,
        normals: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyArray2<u32>>> {
        let mut cloud = self.0.clone();
        cloud.points = copied(py, points.as_array())?;
        cloud.normals = copied(py, normals.as_array())?;
        let triangles = py.detach(|| cloud.triangles());
        let count = triangles.len();
        triangles
            .into_flattened()
            .into_pyarray(py)
            .reshape([count, 3])
    }
}

/// Hands `cloud` over to Python: arrays that own its memory, figures, neighbours.
pub(crate) fn cloud_of(py: Python<'_>, mut cloud: Resampled) -> PyResult<Bound<'_, PyAny>> {
    let rows = |vectors: &mut Vec<[f64; 3]>| {
        let count = vectors.len();
        let flat = std::mem::take(vectors).into_flattened();
        flat.into_pyarray(py).reshape([count, 3])
    };
    let fields = PyDict::new(py);
    fields.set_item("points", rows(&mut cloud.points)?)?;
    fields.set_item("normals", rows(&mut cloud.normals)?)?;
    fields.set_item("source", std::mem::take(&mut cloud.source).into_pyarray(py))?;
    fields.set_item("area", std::mem::take(&mut cloud.areas).into_pyarray(py))?;
    fields.set_item(
        "curvature",
        std::mem::take(&mut cloud.curvatures).into_pyarray(py),
    )?;
    fields.set_item("spacing", cloud.spacing)?;
    let figures = serde_json::to_string(&cloud.uniformity).unwrap_or_default();
    fields.set_item("uniformity", figures)?;
    fields.set_item("rings", Py::new(py, Rings(cloud))?)?;
    Ok(fields.into_any())
}
