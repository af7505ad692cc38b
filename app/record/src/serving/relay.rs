//! Page and recording behind one port: our own, and that of `handeye serve` for a browser that can reach no other.

use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};

use axum::Router;
use axum::extract::{Request, State};
use axum::http::header::{CONTENT_TYPE, HOST, HeaderName, LOCATION};
use axum::http::{StatusCode, Uri};
use axum::response::{IntoResponse as _, Response};
use axum::routing::{any, get};
use re_protos::sdk_comms::v1alpha1::message_proxy_service_server::{MessageProxyService, MessageProxyServiceServer};
use re_protos::sdk_comms::v1alpha1::{
    ReadMessagesRequest, ReadMessagesResponse, ReadTablesRequest, ReadTablesResponse, WriteMessagesRequest,
    WriteMessagesResponse, WriteTableRequest, WriteTableResponse,
};
use rerun::external::re_grpc_server::{MAX_DECODING_MESSAGE_SIZE, MAX_ENCODING_MESSAGE_SIZE, cors_layer};
use tokio_stream::{Stream, StreamExt as _};
use tonic_web::GrpcWebLayer;
use tower::{Layer as _, ServiceExt as _};

use super::page::{Files, encoded};
use super::proxy::Reader;
use handeye_workbench::recording::BROWSER_PATH;

/// The request of a viewer; the other calls of the service write into the recording.
const READ: &str = "/rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages";

/// Files of the viewer.
const FILE: &str = "/rerun/{file}";

/// The browser requests it again after a second.
const REFRESH: HeaderName = HeaderName::from_static("refresh");

/// The recording and the page that shows it, once there is something to look at.
#[derive(Default)]
pub struct Relay(Mutex<Option<Router>>);

impl Relay {
    /// From now on these are served: lasting and live entries.
    ///
    /// # Errors
    /// When there is no page.
    pub(super) fn serve(&self, readers: [Reader; 2]) -> io::Result<()> {
        let service = MessageProxyServiceServer::new(Both(readers))
            .max_decoding_message_size(MAX_DECODING_MESSAGE_SIZE)
            .max_encoding_message_size(MAX_ENCODING_MESSAGE_SIZE);
        // A page that another program of this machine serves asks for permission to read from this port.
        let service = cors_layer(&[]).layer(GrpcWebLayer::new().layer(service));
        let routes = Router::new()
            .route_service(READ, service)
            .route(BROWSER_PATH, get(page))
            .route(FILE, get(file))
            .with_state(Arc::new(Files::load()?));
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(routes);
        Ok(())
    }

    /// The routes: the recording to read, and the page. Access is checked by the server that listens.
    pub fn routes(self: &Arc<Self>) -> Router {
        let answered = any(answer).with_state(Arc::clone(self));
        Router::new().route(READ, answered.clone()).route(BROWSER_PATH, answered.clone()).route(FILE, answered)
    }
}

async fn answer(State(relay): State<Arc<Relay>>, request: Request) -> Response {
    let routes = relay.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
    match routes {
        Some(routes) => routes.oneshot(request).await.unwrap_or_else(|never| match never {}),
        None => not_yet(),
    }
}

/// A file that the page loads.
async fn file(State(files): State<Arc<Files>>, uri: Uri) -> Response {
    files.answer(&uri)
}

/// The page; its address contains where the recording is.
async fn page(State(files): State<Arc<Files>>, request: Request) -> Response {
    if request.uri().query().is_some() {
        return files.answer(request.uri());
    }
    let host = request.headers().get(HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let url = encoded(&format!("rerun+http://{host}/proxy"));
    let there = format!("{BROWSER_PATH}?hide_welcome_screen=1&url={url}");
    (StatusCode::SEE_OTHER, [(LOCATION, there)]).into_response()
}

fn not_yet() -> Response {
    let words = "<!doctype html><meta charset=\"utf-8\"><title>Rerun</title><p>The recording is being opened…</p>\
                 <p>正在打开记录…</p>";
    (StatusCode::SERVICE_UNAVAILABLE, [(CONTENT_TYPE, "text/html; charset=utf-8"), (REFRESH, "1")], words)
        .into_response()
}

/// Two services that are read as one.
#[derive(Clone)]
struct Both([Reader; 2]);

type Messages<T> = Pin<Box<dyn Stream<Item = Result<T, tonic::Status>> + Send>>;

#[tonic::async_trait]
impl MessageProxyService for Both {
    type ReadMessagesStream = Messages<ReadMessagesResponse>;
    type ReadTablesStream = Messages<ReadTablesResponse>;

    async fn read_messages(
        &self,
        _request: tonic::Request<ReadMessagesRequest>,
    ) -> Result<tonic::Response<Self::ReadMessagesStream>, tonic::Status> {
        let [mut lasting, mut live] = self.0.clone();
        let lasting = lasting.read_messages(ReadMessagesRequest {}).await?.into_inner();
        let live = live.read_messages(ReadMessagesRequest {}).await?.into_inner();
        Ok(tonic::Response::new(Box::pin(lasting.merge(live))))
    }

    async fn write_messages(
        &self,
        _request: tonic::Request<tonic::Streaming<WriteMessagesRequest>>,
    ) -> Result<tonic::Response<WriteMessagesResponse>, tonic::Status> {
        Err(only_read())
    }

    async fn write_table(
        &self,
        _request: tonic::Request<WriteTableRequest>,
    ) -> Result<tonic::Response<WriteTableResponse>, tonic::Status> {
        Err(only_read())
    }

    async fn read_tables(
        &self,
        _request: tonic::Request<ReadTablesRequest>,
    ) -> Result<tonic::Response<Self::ReadTablesStream>, tonic::Status> {
        Err(only_read())
    }
}

fn only_read() -> tonic::Status {
    tonic::Status::permission_denied("recordings are only read here")
}
