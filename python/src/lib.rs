//! `splatblur._native`: what the Python layer in `splatblur/` stands on. Its names and types may change in any version.
//!
//! Everything that a user writes is checked in the Python layer, or here, before it reaches the renderer. A value here
//! never changes: setters make a new one. So a scene can be rendered by one thread while another edits its own.

mod arrays;
mod dataset;
mod errors;
mod model;
mod picture;
mod program;
mod render;
mod scene;

/// The command line of the main crate, as it stands.
#[path = "../../src/cli/mod.rs"]
mod cli;

use pyo3::prelude::*;

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("AOVS", splatblur::Aov::LAYERS.map(splatblur::Aov::name))?;
    module.add("METRICS", splatblur::compare::Metric::ALL.map(splatblur::compare::Metric::name))?;
    module.add_class::<model::Object>()?;
    module.add_class::<scene::Camera>()?;
    module.add_class::<scene::Environment>()?;
    module.add_class::<scene::Scene>()?;
    module.add_class::<render::Renderer>()?;
    module.add_class::<picture::Origin>()?;
    module.add_function(wrap_pyfunction!(errors::is_forked, module)?)?;
    module.add_function(wrap_pyfunction!(errors::check_fork, module)?)?;
    module.add_function(wrap_pyfunction!(render::check_choices, module)?)?;
    module.add_function(wrap_pyfunction!(dataset::check_recipe, module)?)?;
    module.add_function(wrap_pyfunction!(scene::check_shutter, module)?)?;
    module.add_function(wrap_pyfunction!(model::copied, module)?)?;
    module.add_function(wrap_pyfunction!(picture::srgb8, module)?)?;
    module.add_function(wrap_pyfunction!(picture::png, module)?)?;
    module.add_function(wrap_pyfunction!(picture::save, module)?)?;
    module.add_function(wrap_pyfunction!(picture::read, module)?)?;
    module.add_function(wrap_pyfunction!(picture::compare, module)?)?;
    module.add_function(wrap_pyfunction!(program::main, module)?)?;
    Ok(())
}
