//! Images and page of a result.

mod cameras;
mod card;
mod page;
mod sides;
