//! The newest figures of a run, for pages and other programs.

use std::collections::VecDeque;
use std::sync::Arc;

use asperity_live::view::{Layout, View};
use axum::body::Bytes;
use parking_lot::Mutex;
use tokio::sync::watch;

use crate::control::Figures;
use crate::wire;

/// Views that are kept for slow pages: half a second, so that one that listens has no gaps. A page further
/// behind gets the newest alone.
const KEPT: usize = 30;

/// The figures of a run. One control thread writes them, every page reads them.
///
/// Nothing here waits for a page, and nothing grows: the newest layout and few views are kept. The lock is
/// held for the exchange of a pointer only.
#[derive(Debug, Default)]
pub struct Feed {
    state: watch::Sender<State>,
    /// Number of the layout that the views belong to, and the samples of each scope since then.
    seen: Mutex<(u64, Vec<u64>)>,
}

#[derive(Debug, Default)]
pub(crate) struct State {
    layout: Arc<Layout>,
    layouts: u64,
    /// Number of published views. A run may restart its own count.
    newest: u64,
    views: VecDeque<Bytes>,
    figures: Arc<Figures>,
}

/// Everything that a page has not seen.
#[derive(Debug, Default)]
pub(crate) struct News {
    pub(crate) layout: Option<(Arc<Layout>, u64)>,
    pub(crate) views: Vec<Bytes>,
    pub(crate) newest: u64,
}

impl Feed {
    /// A feed with nothing to show yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Shows another layout, or the same one with other values. Pages take the values of parameters from it.
    pub fn publish_layout(&self, layout: Layout) {
        let layout = Arc::new(layout);
        self.state.send_modify(|state| (state.layout, state.layouts) = (layout, state.layouts + 1));
    }

    /// Shows new figures. Values that are not finite are shown as missing.
    pub fn publish(&self, view: View) {
        let mut seen = self.seen.lock();
        if seen.0 != view.layout {
            *seen = (view.layout, Vec::new());
        }
        let (layout, mut figures) = {
            let state = self.state.borrow();
            (state.layout.clone(), Figures::clone(&state.figures))
        };
        figures.take(&view, &layout);
        let figures = Arc::new(figures);
        let packed = Bytes::from(wire::view(view, &mut seen.1));
        self.state.send_modify(|state| {
            state.figures = figures;
            state.newest += 1;
            state.views.push_back(packed);
            if state.views.len() > KEPT {
                state.views.pop_front();
            }
        });
    }

    pub(crate) fn layout(&self) -> Arc<Layout> {
        self.state.borrow().layout.clone()
    }

    pub(crate) fn figures(&self) -> Arc<Figures> {
        self.state.borrow().figures.clone()
    }

    pub(crate) fn news(&self) -> watch::Receiver<State> {
        self.state.subscribe()
    }

    /// Everything after layout count `layouts` and view count `seen`. A page at most 30 views behind gets
    /// them all, so that its scopes have no gaps. A page further behind gets the newest.
    pub(crate) fn after(&self, layouts: u64, seen: u64) -> News {
        let state = self.state.borrow();
        let layout = (state.layouts > layouts).then(|| (state.layout.clone(), state.layouts));
        let behind = usize::try_from(state.newest - seen.min(state.newest)).unwrap_or(usize::MAX);
        let take = if behind <= state.views.len() { behind } else { 1.min(state.views.len()) };
        let views = state.views.iter().skip(state.views.len() - take).cloned().collect();
        News { layout, views, newest: state.newest }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slow_page_gets_all_views_or_the_newest() {
        let feed = Feed::new();
        assert!(feed.after(0, 0).views.is_empty());
        feed.publish_layout(Layout::default());
        for number in 0..40 {
            feed.publish(View { number, ..View::default() });
        }
        let news = feed.after(0, 0);
        assert!(news.layout.is_some());
        assert_eq!((news.views.len(), news.newest), (1, 40));
        let news = feed.after(1, 37);
        assert!(news.layout.is_none());
        assert_eq!((news.views.len(), news.newest), (3, 40));
        assert!(feed.after(1, 40).views.is_empty());
        assert_eq!(feed.state.borrow().views.len(), KEPT);
    }
}
