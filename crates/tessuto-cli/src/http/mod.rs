//! HTTP/1.1 as far as the pages of this program need it: servers on this machine, one request a connection. The head of a
//! request is parsed by `httparse`.

mod request;
mod response;

use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use tessuto::{Error, Result};

pub use request::{BodyError, Request, decoded};
pub use response::Response;

/// Longest silence of a client `[s]`: while it asks, and while it takes the answer, which a busy browser may leave waiting.
pub const PATIENCE: [Duration; 2] = [Duration::from_secs(5), Duration::from_secs(120)];
/// Connections at one time; more are closed.
pub const MOST_CONNECTIONS: usize = 48;

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

    /// Hands every connection to `serve`, each in a thread: browsers open connections that they use later or never. Ends
    /// with the program.
    pub fn serve(self, serve: impl Fn(TcpStream) + Send + Sync + 'static) {
        let (serve, open) = (Arc::new(serve), Arc::new(AtomicUsize::new(0)));
        for stream in self.listener.incoming().flatten() {
            let seat = Seat::take(&open);
            // Closing is all the answer that costs nothing.
            let Some(seat) = seat else { continue };
            let serve = serve.clone();
            std::thread::spawn(move || {
                let _seat = seat;
                let timeouts = stream
                    .set_read_timeout(Some(PATIENCE[0]))
                    .and_then(|()| stream.set_write_timeout(Some(PATIENCE[1])));
                if timeouts.is_ok() {
                    serve(stream);
                }
            });
        }
    }
}

/// One of the connections that may be open.
struct Seat(Arc<AtomicUsize>);

impl Seat {
    fn take(open: &Arc<AtomicUsize>) -> Option<Self> {
        let free = |taken: usize| (taken < MOST_CONNECTIONS).then_some(taken + 1);
        open.fetch_update(Ordering::SeqCst, Ordering::SeqCst, free).ok().map(|_| Self(open.clone()))
    }
}

impl Drop for Seat {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::SeqCst);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn seats_are_counted_and_given_back() {
        let open = Arc::default();
        let seats: Vec<_> = (0..MOST_CONNECTIONS).map(|_| Seat::take(&open).unwrap()).collect();
        assert!(Seat::take(&open).is_none());
        drop(seats);
        assert!(Seat::take(&open).is_some());
    }
}
