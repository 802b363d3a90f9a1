//! Records and submits a frame: walks over its rasters, bands, sample positions and steps. Nothing here waits for the
//! device.

use wgpu::ComputePassDescriptor;

use super::ewa::EwaStep;
use super::job::{Job, Place, dispatch};
use super::layout::{OPAQUE_SURFELS, SEE_THROUGH_SURFELS};
use super::prepared::Prepared;
use super::steps::{MapStep, SplatStep, StaticLayerStep, StaticPictureStep, SweepStep};
use super::timestamps::Marks;
use super::transparent::TransparentStep;
use super::{DeviceState, Gpu};
use crate::backend::BackendError;
use crate::plan::{EwaPass, MapPass, Objects, SplatPass, StaticPass, Step, SweepPass};

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
        self.state.device.queue.submit([encoder.finish()]);
        let mut films = programs.film.iter();
        for (raster, of_raster) in frame.rasters.iter().enumerate() {
            for (band, film) in schedule.bands(raster).zip(&mut films) {
                if !of_raster.positions.first().is_some_and(|position| prepared.wants(&position.raster, band)) {
                    continue;
                }
                for position in &of_raster.positions {
                    let place = Place { prepared, programs: &programs, position, raster, band, film };
                    self.state.execute(place, marks)?;
                }
            }
        }
        self.state.device.check()
    }
}

impl DeviceState {
    /// Records and submits the steps of one sample position in one band.
    fn execute(&self, place: Place<'_>, marks: &mut Marks) -> Result<(), BackendError> {
        let (mut has_layer, mut has_opaque) = (false, false);
        for step in &place.position.steps {
            match *step {
                Step::StaticLayer { group } => has_layer = self.static_layer(place, group, marks),
                Step::Splat { group } => {
                    self.clear_opaque(place);
                    has_opaque = self.splat(place, group, has_layer, marks)?;
                }
                Step::Ewa { group } => {
                    self.clear_opaque(place);
                    let programs = self.bound(place.programs.ewa.as_ref())?;
                    has_opaque = self.run(
                        &EwaStep { job: place.ewa_job(group, Objects::All), programs },
                        &EwaPass::ORDER,
                        marks,
                    );
                }
                Step::Transparent { group } => {
                    let has_layers = self.see_through(place, group, has_opaque, marks);
                    let surfels =
                        (u32::from(has_opaque) * OPAQUE_SURFELS) | (u32::from(has_layers) * SEE_THROUGH_SURFELS);
                    let programs = self.bound(place.programs.transparent.as_ref())?;
                    TransparentStep::new(place, group, programs, surfels).run(self, marks);
                }
                Step::StaticPicture { group } => self.static_picture(place, group, marks)?,
                Step::VisibilityMap { group, interval, objects, density } => {
                    let map = place.area().guarded(interval.guard);
                    let job = Job { area: map, map, ..place.job(group, objects) };
                    let programs = self.bound(place.programs.swept.as_ref())?;
                    self.run(&MapStep { job, programs }, MapPass::order(density), marks);
                }
                Step::Sweep { group, ref interval, kernel, objects } => {
                    self.device.queue.write_buffer(&self.buffers.moments, 0, bytemuck::bytes_of(&interval.moments));
                    let job = place.sweep_job(group, interval, objects);
                    let programs = self.bound(place.programs.swept.as_ref())?;
                    self.run(&SweepStep { job, programs }, SweepPass::order(kernel.has_slices()), marks);
                }
                Step::Finish => {
                    let mut encoder = self.encoder();
                    let mut recorder = encoder.begin_compute_pass(&ComputePassDescriptor::default());
                    let program = self.bound(place.film.finish.as_ref())?;
                    dispatch(&mut recorder, program, place.area().tiles, 0);
                    drop(recorder);
                    self.device.queue.submit([encoder.finish()]);
                }
            }
        }
        Ok(())
    }

    /// Empties the opaque picture, where something transparent is laid over it.
    fn clear_opaque(&self, place: Place<'_>) {
        if place.prepared.frame.blending.is_some() {
            let mut encoder = self.encoder();
            encoder.clear_buffer(&self.buffers.opaque, 0, None);
            self.device.queue.submit([encoder.finish()]);
        }
    }

    /// The programs of a step. They are bound for every frame that has the step.
    fn bound<'a, T>(&self, programs: Option<&'a T>) -> Result<&'a T, BackendError> {
        programs.ok_or_else(|| self.device.error("a step's programs were not bound"))
    }

    /// Makes the static layer of a position. False where there is no room for it, or nothing of it is wanted.
    pub(in crate::backend) fn static_layer(&self, place: Place<'_>, group: usize, marks: &mut Marks) -> bool {
        let job = place.job(group, Objects::Static);
        let Some(programs) = place.programs.static_layer.as_ref() else { return false };
        let any = !place.batches(&job).run.is_empty();
        if any {
            self.run(&StaticLayerStep { job, programs }, &StaticPass::ORDER, marks);
        }
        any
    }

    /// Splats a group. It starts from the static layer if there is one. False if the group has nothing to splat.
    pub(in crate::backend) fn splat(
        &self,
        place: Place<'_>,
        group: usize,
        has_layer: bool,
        marks: &mut Marks,
    ) -> Result<bool, BackendError> {
        if has_layer {
            let job = Job { from_layer: true, ..place.job(group, Objects::Moving) };
            let layer = Some(self.bound(place.programs.static_layer.as_ref())?);
            Ok(self.run(&SplatStep { job, layer }, &SplatPass::ORDER, marks))
        } else {
            let job = place.job(group, Objects::All);
            Ok(self.run(&SplatStep { job, layer: None }, &SplatPass::ORDER, marks))
        }
    }

    /// Makes the picture of static objects at a position, in the light of a group.
    pub(in crate::backend) fn static_picture(
        &self,
        place: Place<'_>,
        group: usize,
        marks: &mut Marks,
    ) -> Result<(), BackendError> {
        let programs = self.bound(place.programs.swept.as_ref())?;
        let resolve = self.bound(programs.static_picture.as_ref())?;
        let guard = place.prepared.frame.guard().unwrap_or(0);
        let job = Job { map: place.area().guarded(guard), ..place.job(group, Objects::Static) };
        let mut encoder = self.encoder();
        encoder.clear_buffer(&self.buffers.static_film, 0, None);
        self.flush(&mut encoder, marks);
        let step = StaticPictureStep { job, resolve };
        self.run(&step, &StaticPass::ORDER, marks);
        let mut encoder = self.encoder();
        step.cache_thresholds(self, &mut encoder);
        self.flush(&mut encoder, marks);
        Ok(())
    }
}
