//! Records and submits a frame: walks over its rasters, bands, sample positions and steps. Nothing here waits for the
//! device.

use wgpu::ComputePassDescriptor;

use super::batches::{Batch, SharedRest};
use super::bind::SurfelPrograms;
use super::job::{Job, JobPlace, dispatch};
use super::layout::{OPAQUE_SURFELS, SEE_THROUGH_SURFELS};
use super::memory::shares_film;
use super::paint::PaintStep;
use super::prepared::Prepared;
use super::steps::{MapStep, PublishedSweepStep, SweepStep};
use super::timestamps::Marks;
use super::transparent::TransparentStep;
use super::{DeviceState, Gpu};
use crate::backend::BackendError;
use crate::plan::{MapPass, PaintPass, Published, PublishedSweepPass, Step, SweepPass};

impl Gpu {
    /// Records and submits all steps of a frame.
    pub(in crate::backend) fn submit(
        &mut self,
        prepared: &Prepared<'_>,
        marks: &mut Marks,
    ) -> Result<(), BackendError> {
        let programs = self.bind(prepared, marks)?;
        let Prepared { frame, schedule, .. } = prepared;
        let mut encoder = self.state.encoder();
        encoder.clear_buffer(&self.state.buffers.film, 0, None);
        encoder.clear_buffer(&self.state.buffers.status, 0, None);
        self.state.device.submit([encoder]);
        let mut films = programs.film.iter();
        for (raster, of_raster) in frame.rasters.iter().enumerate() {
            for (band, film) in schedule.bands(raster).zip(&mut films) {
                if !of_raster.positions.first().is_some_and(|position| prepared.wants(&position.raster, band)) {
                    continue;
                }
                for position in &of_raster.positions {
                    let place = JobPlace { prepared, programs: &programs, position, raster, band, film };
                    self.state.execute(place, marks)?;
                }
            }
        }
        self.state.device.check()
    }
}

impl DeviceState {
    /// Records and submits the steps of one sample position in one band.
    fn execute(&self, place: JobPlace<'_>, marks: &mut Marks) -> Result<(), BackendError> {
        let (mut has_opaque, mut has_layers) = (false, false);
        let mut rest = SharedRest::default();
        for step in &place.position.steps {
            match *step {
                Step::Paint { group, shares_rest } => {
                    let mut job = place.paint_job(group, false);
                    let mut batches = place.batches(&job);
                    // Later steps of what is transparent write other splats to the buffers.
                    if shares_rest && place.prepared.frame.blending.is_none() {
                        job.flags = rest.next(&mut batches, shares_film(place.prepared.frame));
                    }
                    has_opaque = self.paint(job, &batches, marks)?;
                }
                Step::Published { group, part: Published::Instant } => {
                    let job = place.paint_job(group, false);
                    has_opaque = self.paint(job, &place.batches(&job), marks)?;
                }
                Step::Peel { group } => has_layers = self.see_through(place, group, has_opaque, marks),
                Step::Composite { group } => {
                    let surfels =
                        (u32::from(has_opaque) * OPAQUE_SURFELS) | (u32::from(has_layers) * SEE_THROUGH_SURFELS);
                    let Some(programs) = &place.programs.transparent else { return Err(self.unbound()) };
                    TransparentStep::new(place, group, programs, surfels).run(self, marks);
                }
                Step::Sweep { group, ref interval, .. } => {
                    self.device.write(&self.buffers.moments, 0, bytemuck::bytes_of(&interval.moments));
                    let job = place.sweep_job(group, interval);
                    let SurfelPrograms::Sweep(programs) = &place.programs.surfels else { return Err(self.unbound()) };
                    self.run(&SweepStep { job, programs }, &SweepPass::ORDER, marks);
                }
                Step::Published { group, part: Published::Map { guard } } => {
                    let map = place.area().guarded(guard);
                    let job = Job { area: map, map, ..place.job(group) };
                    let SurfelPrograms::Published(programs, _) = &place.programs.surfels else {
                        return Err(self.unbound());
                    };
                    self.run(&MapStep { job, programs }, &MapPass::ORDER, marks);
                }
                Step::Published { group, part: Published::Sweep { ref interval, .. } } => {
                    self.device.write(&self.buffers.moments, 0, bytemuck::bytes_of(&interval.moments));
                    let job = place.sweep_job(group, interval);
                    let SurfelPrograms::Published(_, programs) = &place.programs.surfels else {
                        return Err(self.unbound());
                    };
                    self.run(&PublishedSweepStep { job, programs }, &PublishedSweepPass::ORDER, marks);
                }
                Step::Finish => {
                    let mut encoder = self.encoder();
                    let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor::default());
                    let Some(program) = &place.film.finish else { return Err(self.unbound()) };
                    dispatch(&mut recorder, program, place.area().tiles, 0);
                    drop(recorder);
                    self.device.submit([encoder]);
                }
            }
        }
        Ok(())
    }

    /// Paints a group, which is cut into `batches`. False if there is none.
    fn paint(&self, job: Job<'_>, batches: &[Batch], marks: &mut Marks) -> Result<bool, BackendError> {
        self.clear_opaque(job.place);
        let SurfelPrograms::Paint(programs) = &job.place.programs.surfels else { return Err(self.unbound()) };
        let passes = PaintPass::order(job.place.prepared.channels.is_layered());
        Ok(self.run_batches(&PaintStep { job, programs }, batches, passes, marks))
    }

    /// Empties the opaque picture, where something transparent is laid over it.
    fn clear_opaque(&self, place: JobPlace<'_>) {
        if place.prepared.frame.blending.is_some() {
            let mut encoder = self.encoder();
            encoder.clear_buffer(&self.buffers.opaque, 0, None);
            self.device.submit([encoder]);
        }
    }

    /// The error of a step whose programs are not bound. They are, for every frame that has the step.
    fn unbound(&self) -> BackendError {
        self.device.error("a step's programs were not bound")
    }
}
