pub type Asset = (&'static str, &'static str, &'static str);

const HTML: &str = "text/html; charset=utf-8";
const CSS: &str = "text/css; charset=utf-8";
const SCRIPT: &str = "text/javascript; charset=utf-8";
const TEXT: &str = "text/plain; charset=utf-8";

macro_rules! web {
    ($($path:literal $file:literal $kind:ident,)*) => {
        pub const ALL: &[Asset] =
            &[$(($path, $kind, include_str!(concat!("../web/", $file)))),*];
    };
}

web! {
    "/" "page.html" HTML,
    "/page.css" "page.css" CSS,
    "/uplot.css" "uplot.css" CSS,
    "/uplot.js" "uplot.js" SCRIPT,
    "/uplot-license.txt" "uplot-license.txt" TEXT,
    "/store.js" "store.js" SCRIPT,
    "/map.js" "map.js" SCRIPT,
    "/field.js" "field.js" SCRIPT,
    "/charts.js" "charts.js" SCRIPT,
    "/timeline.js" "timeline.js" SCRIPT,
    "/orders.js" "orders.js" SCRIPT,
    "/hand.js" "hand.js" SCRIPT,
    "/net.js" "net.js" SCRIPT,
    "/page.js" "page.js" SCRIPT,
}
