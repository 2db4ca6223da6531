//! Session of one browser: token, new data, orders.

use std::{
    sync::Arc,
    time::{Duration, Instant},
};

use axum::extract::ws::{CloseFrame, Message, WebSocket};
use futures_util::{SinkExt as _, StreamExt as _, stream::SplitSink};
use serde::Deserialize;
use serde_json::json;
use tokio::{
    sync::{Semaphore, mpsc},
    task::spawn_blocking,
    time::{MissedTickBehavior, interval, timeout},
};

use crate::{
    access::Role,
    context::Context,
    orders::{Asked, Order},
    places::{Place, lost},
    shared::Cursor,
};

const TOKEN_WITHIN: Duration = Duration::from_secs(3);
const SEND_EVERY: Duration = Duration::from_millis(100);
const ALIVE_EVERY: Duration = Duration::from_millis(300);
const TAKEN_WITHIN: Duration = Duration::from_secs(10);
/// Longest time for a resumed robot to go on.
const GOES_WITHIN: Duration = Duration::from_secs(3);
const MOST_A_SECOND: u32 = 50;
/// Most simultaneous orders except stops, and most simultaneous stops.
const MOST_ORDERS: usize = 1;
const MOST_STOPS: usize = 3;
static ORDERS: Semaphore = Semaphore::const_new(MOST_ORDERS);
static STOPS: Semaphore = Semaphore::const_new(MOST_STOPS);

/// Websocket codes from 4000 belong to the application.
const WRONG_TOKEN: u16 = 4401;
/// Timeout or lost place. The browser reconnects.
const LATE: u16 = 4408;
const REPLACED: u16 = 4409;
const TOO_MUCH: u16 = 4429;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Hello {
    token: String,
}

type Sender = SplitSink<WebSocket, Message>;

/// Serves a browser, with the place `stranger` before it shows a token.
pub async fn run(mut socket: WebSocket, stranger: Place, context: &Arc<Context>) {
    let first = tokio::select! {
        first = timeout(TOKEN_WITHIN, socket.recv()) => first.ok().flatten(),
        () = lost(&stranger) => None,
    };
    let role = match &first {
        Some(Ok(Message::Text(text))) => serde_json::from_str::<Hello>(text)
            .ok()
            .and_then(|hello| context.access.role(&hello.token)),
        _ => None,
    };
    let (sender, mut receiver) = socket.split();
    let Some(role) = role else {
        close(sender, if first.is_some() { WRONG_TOKEN } else { LATE }).await;
        return;
    };
    drop(stranger);
    let places = if role == Role::Drive { &context.driving } else { &context.watching };
    let place = places.take();
    let (answers, told) = mpsc::channel(16);
    let sending = tokio::spawn(send(sender, Cursor::new(&context.shared), role, told));
    let (mut counted_since, mut count) = (Instant::now(), 0);
    let code = loop {
        let message = tokio::select! {
            message = receiver.next() => message,
            () = lost(&place) => break Some(REPLACED),
        };
        let Some(Ok(message)) = message else {
            break None;
        };
        if counted_since.elapsed() >= Duration::from_secs(1) {
            (counted_since, count) = (Instant::now(), 0);
        }
        count += 1;
        if count > MOST_A_SECOND {
            break Some(TOO_MUCH);
        }
        if let Message::Text(text) = message
            && let Ok(asked) = serde_json::from_str(&text)
        {
            tokio::spawn(perform(asked, role, context.clone(), answers.clone()));
        }
    };
    match code {
        // The sending task closes the socket when it ends.
        Some(code) => {
            let _ = answers.try_send(Told::Close(code));
        }
        None => sending.abort(),
    }
}

enum Told {
    Answer(String),
    Close(u16),
}

async fn send(mut sender: Sender, mut cursor: Cursor, role: Role, mut told: mpsc::Receiver<Told>) {
    const { assert!(SEND_EVERY.as_millis() < ALIVE_EVERY.as_millis()) };
    let mut ticks = interval(SEND_EVERY);
    ticks.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut sent = Instant::now();
    let hello = json!({"role": if role == Role::Drive { "drive" } else { "watch" }});
    let mut due = vec![Message::text(hello.to_string())];
    loop {
        if !due.is_empty() {
            sent = Instant::now();
        }
        for message in due.drain(..) {
            match timeout(TAKEN_WITHIN, sender.send(message)).await {
                Ok(Ok(())) => {}
                _ => return,
            }
        }
        tokio::select! {
            answer = told.recv() => match answer {
                Some(Told::Answer(answer)) => due.push(Message::text(answer)),
                Some(Told::Close(code)) => return close(sender, code).await,
                None => return,
            },
            _ = ticks.tick() => {
                let news = cursor.news();
                if !news.text.is_empty() {
                    due.push(Message::text(news.text));
                }
                due.extend(news.blobs.into_iter().map(Message::Binary));
                if due.is_empty() && sent.elapsed() >= ALIVE_EVERY {
                    due.push(Message::text("{}"));
                }
            }
        }
    }
}

async fn close(mut sender: Sender, code: u16) {
    let frame = CloseFrame { code, reason: Default::default() };
    let _ = timeout(TAKEN_WITHIN, sender.send(Message::Close(Some(frame)))).await;
}

async fn perform(asked: Asked, role: Role, context: Arc<Context>, answers: mpsc::Sender<Told>) {
    let Asked { id, order } = asked;
    let simulated = context.shared.lock().simulated;
    let done = match order.refusal(role, simulated) {
        Some(why) => Err(why.to_owned()),
        None => done(order, &context).await,
    };
    let (ok, Ok(text) | Err(text)) = (done.is_ok(), done);
    let answer = json!({"answer": {"id": id, "ok": ok, "text": text}});
    let _ = answers.send(Told::Answer(answer.to_string())).await;
}

async fn done(order: Order, context: &Arc<Context>) -> Result<String, String> {
    if let Order::Preview { x, y } = order {
        context.shared.lock().wanted = Some([x, y]);
        return Ok(String::new());
    }
    let permits = if order == Order::Stop { &STOPS } else { &ORDERS };
    let Ok(permit) = permits.try_acquire() else {
        return Err("the previous order is still under way".to_owned());
    };
    let operator = context.operator.clone();
    let resumes = order == Order::Resume;
    let done = spawn_blocking(move || operator(&order)).await;
    drop(permit);
    let told = done.unwrap_or_else(|error| Err(format!("the order failed: {error}")))?;
    if resumes { resumed(context).await } else { Ok(told) }
}

async fn resumed(context: &Arc<Context>) -> Result<String, String> {
    let mut link = context.shared.link.subscribe();
    let goes = timeout(GOES_WITHIN, link.wait_for(|(stopped, _)| !stopped)).await.is_ok();
    let says = link.borrow().1.clone();
    if goes { Ok(says) } else { Err(says) }
}
