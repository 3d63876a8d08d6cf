//! The checkpoint that a render continues from, and the identity of its scene for checkpoints and shards.

use super::checkpoint::{self, Head};
use super::load::Environment;
use super::request::Request;
use crate::error::{Error, ErrorKind, Result};
use crate::render::{Settings, State};
use crate::scene::Scene;

/// The identity of a render's scene, and the state that the render continues from.
pub(super) struct Resumption {
    /// Hash of the scene's files, hexadecimal. `None` if nothing needs it, or if the scene came through a pipe and
    /// cannot be read again.
    pub scene: Option<String>,
    /// The checkpoint from which the render continues; `None` if it starts anew.
    pub saved: Option<(Head, State)>,
}

impl Resumption {
    /// Reads the checkpoint of a request, if it names one, and checks that it belongs to the render.
    ///
    /// # Errors
    /// The checkpoint cannot be read, belongs to another render, or has more iterations than the request.
    pub fn read(request: &Request, scene: &Scene, settings: &Settings) -> Result<Resumption> {
        let Some(path) = &request.resume else {
            let is_stored = request.saving.is_some() || settings.is_shard();
            let scene = if is_stored { hash(request, scene)? } else { None };
            return Ok(Resumption { scene, saved: None });
        };
        let scene = hash(request, scene)?;
        let (head, state) = checkpoint::read(path)?;
        checkpoint::check(path, &head, scene.as_deref(), &request.arguments)?;
        let done = state.iterations();
        if let Some(asked) = settings.iterations_of_shard().filter(|asked| *asked < done) {
            let cause = format!("has {done} iterations already, and --iterations asks for {asked}");
            let error = Error::new(ErrorKind::Usage, path.display(), cause);
            return Err(error.hint("ask for more, or start anew without --resume"));
        }
        Ok(Resumption { scene, saved: Some((head, state)) })
    }
}

/// A hash of the files that the scene is read from; `None` if it came through a pipe and cannot be read again.
fn hash(request: &Request, scene: &Scene) -> Result<Option<String>> {
    let environment = match &request.scene.environment {
        Some(Environment::File(path)) => Some(path.as_path()),
        _ => None,
    };
    let allow_outside = request.scene.options.allow_outside;
    checkpoint::hash(&request.scene.path, scene.converted.as_deref(), environment, allow_outside)
}
