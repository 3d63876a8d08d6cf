//! The checkpoint that a render continues from, and the identity of its scene for checkpoints and shards.

use super::checkpoint::{self, Head};
use super::request::Request;
use crate::error::{Error, ErrorKind, Result};
use crate::render::{Settings, State};

/// The identity of a render's scene, and the state that the render continues from.
pub(super) struct Resumption {
    /// [`Loaded::hash`](super::load::Loaded::hash).
    pub scene: Option<String>,
    /// The checkpoint from which the render continues; `None` if it starts anew.
    pub saved: Option<(Head, State)>,
}

impl Resumption {
    /// Reads the checkpoint of a request, if it names one, and checks that it belongs to the render of the scene with this
    /// hash.
    ///
    /// # Errors
    /// The checkpoint cannot be read, belongs to another render, or has more iterations than the request.
    pub fn read(request: &Request, scene: Option<String>, settings: &Settings) -> Result<Resumption> {
        let Some(path) = &request.resume else { return Ok(Resumption { scene, saved: None }) };
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
