//! Records a frame, task by task. Nothing here waits for the device.

use wgpu::CommandEncoder;

use super::Gpu;
use super::bind::BoundPrograms;
use super::passes::Program;
use super::prepared::Prepared;
use super::recorder::Recorder;
use super::rounds::{Chunk, Task, walk};
use super::slots::Slot;
use super::steps::Kind;
use super::timestamps::Marks;
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
        for slot in [Slot::Film, Slot::Status] {
            encoder.clear_buffer(&self.state.buffers[slot], 0, None);
        }
        let mut bound = BoundPrograms::default();
        for (number, Chunk { tasks, upload }) in walk(prepared, self.state.buffers.entries).enumerate() {
            if number > 0 {
                // What was uploaded for the chunk before is in use until that is submitted.
                self.state.device.submit([encoder]);
                encoder = self.state.encoder();
            }
            if number == 0 || !upload.fits(&self.state.buffers) {
                self.fit(prepared, &upload)?;
                bound = BoundPrograms::default();
            }
            upload.write(&self.state);
            let mut recorder = Recorder::new(prepared, &mut self.state, &mut bound, marks, encoder);
            for task in &tasks {
                recorder.task(prepared, task)?;
            }
            encoder = recorder.end();
        }
        self.state.device.check()?;
        Ok(encoder)
    }
}

impl Recorder<'_> {
    /// Records a task.
    fn task(&mut self, prepared: &Prepared<'_>, task: &Task) -> Result<(), BackendError> {
        match task {
            Task::Paint { film, placed } => {
                if prepared.frame.blending.is_some() {
                    // Something transparent is laid over it.
                    self.clear(Slot::Opaque);
                }
                self.run((Kind::Paint, *film), placed, PaintPass::order(prepared.channels.is_layered()))?;
            }
            Task::Peel(placed) => {
                self.run((Kind::Peel, 0), placed, &LayerPass::order(prepared.frame.has_layers(true)))?;
            }
            Task::Composite { film, step } => step.run(self, *film)?,
            Task::Sweep { film, placed } => self.run((Kind::Sweep, *film), placed, &SweepPass::ORDER)?,
            Task::Map(placed) => self.run((Kind::Map, 0), placed, &MapPass::ORDER)?,
            Task::PublishedSweep { film, placed } => {
                self.run((Kind::Published, *film), placed, &PublishedSweepPass::ORDER)?;
            }
            Task::Finish { film, placed } => {
                self.programs((Kind::Sweep, *film), &[Program::Finish], placed)?;
            }
        }
        self.flush_if_long();
        Ok(())
    }
}
