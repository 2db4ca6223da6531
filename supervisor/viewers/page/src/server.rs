//! Connections and requests, with bounded memory and time independent of the client.

use std::{convert::Infallible, net::TcpListener, sync::Arc, time::Duration};

use axum::{
    body::Body,
    extract::{FromRequestParts as _, Request, ws::WebSocketUpgrade},
    http::{HeaderMap, Method, StatusCode, header},
    response::{IntoResponse as _, Response},
};
use hyper::{body::Incoming, server::conn::http1, service::service_fn};
use hyper_util::rt::{TokioIo, TokioTimer};
use page::assets;
use tokio::{net::TcpStream, time::timeout};

use crate::{
    context::Context,
    places::{Place, Places, lost},
    session,
};

const MOST_STRANGERS: usize = 64;
const REQUEST_WITHIN: Duration = Duration::from_secs(3);
/// Lifetime of a connection that does not become a websocket.
const ANSWERED_WITHIN: Duration = Duration::from_secs(10);
const MOST_HEADER_BYTES: usize = 16 << 10;
const MOST_MESSAGE_BYTES: usize = 4 << 10;
const LIVE: &str = "/live";

pub async fn serve(context: Arc<Context>, listener: TcpListener) {
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else {
        tracing::error!("the system refuses to watch the page's socket");
        return;
    };
    let strangers = Places::new(MOST_STRANGERS);
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        let (context, place) = (context.clone(), strangers.take());
        tokio::spawn(async move {
            tokio::select! {
                () = connection(&context, stream, &place) => {}
                () = lost(&place) => {}
            }
        });
    }
}

async fn connection(context: &Arc<Context>, stream: TcpStream, place: &Place) {
    let service = service_fn(|request: hyper::Request<Incoming>| {
        let (context, place) = (context.clone(), place.clone());
        async move { Ok::<_, Infallible>(answer(&context, request.map(Body::new), place).await) }
    });
    let connection = http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(REQUEST_WITHIN)
        .max_buf_size(MOST_HEADER_BYTES)
        .keep_alive(false)
        .serve_connection(TokioIo::new(stream), service)
        .with_upgrades();
    // The client may leave or be late at any time.
    let _ = timeout(ANSWERED_WITHIN, connection).await;
}

async fn answer(context: &Arc<Context>, request: Request, place: Place) -> Response {
    let Some(host) = host(context, &request) else {
        return StatusCode::MISDIRECTED_REQUEST.into_response();
    };
    let path = request.uri().path().to_owned();
    let is_own = single(request.headers(), &header::ORIGIN)
        .is_some_and(|origin| context.access.is_own_origin(origin, &host));
    let has_origin = request.headers().contains_key(header::ORIGIN);
    if !is_own && (has_origin || path == LIVE || request.method() != Method::GET) {
        return StatusCode::FORBIDDEN.into_response();
    }
    if request.method() != Method::GET {
        return StatusCode::METHOD_NOT_ALLOWED.into_response();
    }
    if path == LIVE {
        return session(context, request, place).await;
    }
    let Some((_, kind, text)) = assets::ALL.iter().find(|(at, ..)| *at == path) else {
        return StatusCode::NOT_FOUND.into_response();
    };
    let policy = format!(
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src {}; \
         base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
        context.access.websocket(&host)
    );
    let headers = [
        (header::CONTENT_TYPE, (*kind).to_owned()),
        (header::CONTENT_SECURITY_POLICY, policy),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::X_CONTENT_TYPE_OPTIONS, "nosniff".to_owned()),
        (header::REFERRER_POLICY, "no-referrer".to_owned()),
    ];
    (headers, *text).into_response()
}

/// Returns the host of `request` if its headers agree and the page answers to it.
fn host(context: &Context, request: &Request) -> Option<String> {
    let host = context.access.host(single(request.headers(), &header::HOST)?)?;
    request
        .uri()
        .authority()
        .is_none_or(|absolute| absolute.as_str() == host)
        .then(|| host.to_owned())
}

async fn session(context: &Arc<Context>, request: Request, place: Place) -> Response {
    let (mut parts, _) = request.into_parts();
    let upgrade = match WebSocketUpgrade::from_request_parts(&mut parts, &()).await {
        Ok(upgrade) => upgrade,
        Err(refused) => return refused.into_response(),
    };
    let context = context.clone();
    upgrade.max_message_size(MOST_MESSAGE_BYTES).max_frame_size(MOST_MESSAGE_BYTES).on_upgrade(
        async move |socket| {
            session::run(socket, place, &context).await;
        },
    )
}

fn single<'a>(headers: &'a HeaderMap, name: &header::HeaderName) -> Option<&'a str> {
    let mut values = headers.get_all(name).iter();
    let value = values.next()?;
    values.next().is_none().then(|| value.to_str().ok()).flatten()
}
