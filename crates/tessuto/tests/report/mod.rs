//! Images and page of a result.

mod card;
mod page;
