//! HTTP/1.1 as far as the pages of this program need it: servers on this machine, one request a connection. The
//! head of a request is parsed by `httparse`.

mod gate;
mod request;
mod response;
mod seats;

use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::Arc;
use std::time::Duration;

use tessuto::{Error, Result};

pub use gate::Gate;
pub use request::{BodyError, Request, decoded};
pub use response::Response;
pub use seats::Seat;
use seats::Seats;

/// Longest silence of a client `[s]`: while it asks, and while it takes the answer, which a busy browser may leave
/// waiting.
pub const PATIENCE: [Duration; 2] = [Duration::from_secs(5), Duration::from_secs(120)];
/// A port of 127.0.0.1 that is ours.
pub struct Listener {
    listener: TcpListener,
    /// Its number.
    pub port: u16,
}

impl Listener {
    /// Takes `port` of 127.0.0.1, which other machines cannot reach; 0 is any free one. `option` is what asked for it.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is taken.
    pub fn bind(port: u16, option: &str) -> Result<Self> {
        let bound = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
            .and_then(|listener| Ok(Self { port: listener.local_addr()?.port(), listener }));
        bound.map_err(|e| {
            let hint = "choose another port, or leave it out for a free one";
            Error::usage(format!("{option} {port}: {e}"), hint)
        })
    }

    /// Where a browser finds it.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/", self.port)
    }

    /// Hands every connection to `serve`, each in a thread: browsers open connections that they use later or
    /// never. Ends with the program.
    pub fn serve(self, serve: impl Fn(TcpStream, &Seat) + Send + Sync + 'static) {
        let (serve, seats) = (Arc::new(serve), Seats::default());
        for stream in self.listener.incoming().flatten() {
            // Closing is all the answer that costs nothing.
            let Some(seat) = seats.take(&stream) else { continue };
            let serve = serve.clone();
            std::thread::spawn(move || {
                let timeouts = stream
                    .set_read_timeout(Some(PATIENCE[0]))
                    .and_then(|()| stream.set_write_timeout(Some(PATIENCE[1])));
                if timeouts.is_ok() {
                    serve(stream, &seat);
                }
            });
        }
    }
}
