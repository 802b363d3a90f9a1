//! Records a frame, task by task. Nothing here waits for the device.

use wgpu::CommandEncoder;

use super::Gpu;
use super::bind::SurfelPrograms;
use super::paint::PaintStep;
use super::prepared::Prepared;
use super::recorder::{Recorder, dispatch};
use super::rounds::{Chunk, Task, walk};
use super::see_through::SeeThroughStep;
use super::steps::{MapStep, PublishedSweepStep, SweepStep};
use super::timestamps::{Marks, Stage};
use crate::backend::BackendError;
use crate::plan::{LayerPass, MapPass, PaintPass, PublishedSweepPass, SweepPass};

impl Gpu {
    /// Records all steps of a frame. Chunks are submitted, except what is returned: the end of the last one.
    pub(in crate::backend) fn record(
        &mut self,
        prepared: &Prepared<'_>,
        marks: &mut Marks,
    ) -> Result<CommandEncoder, BackendError> {
        let mut encoder = self.state.encoder();
        encoder.clear_buffer(&self.state.buffers.film, 0, None);
        encoder.clear_buffer(&self.state.buffers.status, 0, None);
        let mut bound = None;
        for (number, Chunk { tasks, upload }) in walk(prepared, self.state.buffers.entries).enumerate() {
            if number > 0 {
                // What was uploaded for the chunk before is in use until that is submitted.
                self.state.device.submit([encoder]);
                encoder = self.state.encoder();
            }
            if !upload.fits(&self.state.buffers) {
                bound = None;
            }
            let programs = match bound {
                Some(programs) => programs,
                None => self.bind(prepared, &upload)?,
            };
            upload.write(&self.state);
            let mut recorder = Recorder::new(&self.state, &programs, marks, encoder);
            for task in &tasks {
                recorder.task(prepared, task)?;
            }
            encoder = recorder.end();
            bound = Some(programs);
        }
        self.state.device.check()?;
        Ok(encoder)
    }
}

impl Recorder<'_> {
    /// Records a task.
    fn task(&mut self, prepared: &Prepared<'_>, task: &Task) -> Result<(), BackendError> {
        let (programs, state) = (self.programs, self.state);
        let unbound = || state.device.error("a step's programs were not bound");
        match task {
            Task::Paint { film, placed } => {
                if prepared.frame.blending.is_some() {
                    // Something transparent is laid over it.
                    self.encoder.clear_buffer(&state.buffers.opaque, 0, None);
                }
                let SurfelPrograms::Paint(of_step) = &programs.surfels else { return Err(unbound()) };
                let step = PaintStep { programs: of_step, film: &programs.film[*film] };
                self.run(&step, placed, PaintPass::order(prepared.channels.is_layered()));
            }
            Task::Peel(placed) => {
                let Some(of_step) = &programs.see_through else { return Err(unbound()) };
                let step = SeeThroughStep { programs: of_step, in_one_batch: placed.len() == 1 };
                self.run(&step, placed, &LayerPass::order(prepared.frame.has_layers(true)));
            }
            Task::Composite { film, step } => {
                let Some(of_step) = &programs.transparent else { return Err(unbound()) };
                step.run(self, of_step, &programs.film[*film]);
            }
            Task::Sweep { film, placed } => {
                let SurfelPrograms::Sweep(of_step) = &programs.surfels else { return Err(unbound()) };
                let step = SweepStep { film: &programs.film[*film], programs: of_step };
                self.run(&step, placed, &SweepPass::ORDER);
            }
            Task::Map(placed) => {
                let SurfelPrograms::Published(of_step, _) = &programs.surfels else { return Err(unbound()) };
                self.run(&MapStep { programs: of_step }, placed, &MapPass::ORDER);
            }
            Task::PublishedSweep { film, placed } => {
                let SurfelPrograms::Published(_, of_step) = &programs.surfels else { return Err(unbound()) };
                let step = PublishedSweepStep { film: &programs.film[*film], programs: of_step };
                self.run(&step, placed, &PublishedSweepPass::ORDER);
            }
            Task::Finish { film, view, tiles } => {
                let Some(finish) = &programs.film[*film].finish else { return Err(unbound()) };
                dispatch(&mut self.pass(Stage::Resolve), finish, *tiles, *view);
            }
        }
        self.flush_if_long();
        Ok(())
    }
}
