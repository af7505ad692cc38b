//! Page and recording behind one port: our own, and that of `handeye serve` for a browser that reaches no other.

use std::io;
use std::pin::Pin;
use std::sync::{Arc, Mutex, PoisonError};

use http_body_util::Full;
use hyper::body::{Bytes, Incoming};
use hyper::header::{CONTENT_TYPE, HOST, HeaderName, HeaderValue, LOCATION};
use hyper::service::Service as _;
use hyper::{Request, Response, StatusCode};
use hyper_util::service::TowerToHyperService;
use re_protos::sdk_comms::v1alpha1::message_proxy_service_server::{MessageProxyService, MessageProxyServiceServer};
use re_protos::sdk_comms::v1alpha1::{
    ReadMessagesRequest, ReadMessagesResponse, ReadTablesRequest, ReadTablesResponse, WriteMessagesRequest,
    WriteMessagesResponse, WriteTableRequest, WriteTableResponse,
};
use rerun::external::re_grpc_server::{MAX_DECODING_MESSAGE_SIZE, MAX_ENCODING_MESSAGE_SIZE, cors_layer};
use tokio_stream::{Stream, StreamExt as _};
use tonic::body::Body;
use tonic_web::{GrpcWebLayer, GrpcWebService};
use tower::Layer as _;
use tower_http::cors::Cors;

use super::page::{Files, encoded};
use super::proxy::Reader;
use handeye_http::door::plain;
use handeye_workbench::recording::BROWSER_PATH;

/// What a viewer asks for; what else the service can do is to write into the recording.
const READ: &str = "/rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages";

/// The browser asks again after a second.
const REFRESH: HeaderName = HeaderName::from_static("refresh");

type Answers = TowerToHyperService<Cors<GrpcWebService<MessageProxyServiceServer<Both>>>>;

/// The recording and the page that shows it, once there is something to look at.
#[derive(Default)]
pub struct Relay(Mutex<Option<Arc<Relayed>>>);

/// The page, and what it reads.
struct Relayed {
    files: Files,
    service: Answers,
}

impl Relay {
    /// From now on this is served: what lasts, and what is live.
    ///
    /// # Errors
    /// When there is no page.
    pub(super) fn serve(&self, readers: [Reader; 2]) -> io::Result<()> {
        let service = MessageProxyServiceServer::new(Both(readers))
            .max_decoding_message_size(MAX_DECODING_MESSAGE_SIZE)
            .max_encoding_message_size(MAX_ENCODING_MESSAGE_SIZE);
        // A page that another program of this machine serves asks whether it may read from this port.
        let service = TowerToHyperService::new(cors_layer(&[]).layer(GrpcWebLayer::new().layer(service)));
        let relayed = Relayed { files: Files::load()?, service };
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some(Arc::new(relayed));
        Ok(())
    }

    /// Whether a request is for the page or for the recording.
    pub fn is_for<B>(request: &Request<B>) -> bool {
        let path = request.uri().path();
        path.starts_with(BROWSER_PATH) || path == READ
    }

    /// Answers such a request. The one who asks has been let in by whoever listens.
    pub async fn answer(&self, request: Request<Incoming>) -> Response<Body> {
        let relayed = self.0.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let Some(relayed) = relayed else { return not_yet() };
        let path = request.uri().path();
        if path == READ {
            let answer = relayed.service.call(request).await.unwrap_or_else(|never| match never {});
            return answer.map(Body::new);
        }
        if path == BROWSER_PATH && request.uri().query().is_none() {
            return with_recording(&request);
        }
        let file = path.strip_prefix(BROWSER_PATH).unwrap_or_default();
        relayed.files.answer(request.method(), &format!("/{file}"))
    }
}

/// The viewer is told in its address where the recording is.
fn with_recording<B>(request: &Request<B>) -> Response<Body> {
    let host = request.headers().get(HOST).and_then(|host| host.to_str().ok()).unwrap_or_default();
    let url = encoded(&format!("rerun+http://{host}/proxy"));
    let mut response = plain(StatusCode::SEE_OTHER, "");
    if let Ok(there) = HeaderValue::from_str(&format!("{BROWSER_PATH}?hide_welcome_screen=1&url={url}")) {
        response.headers_mut().insert(LOCATION, there);
    }
    response
}

fn not_yet() -> Response<Body> {
    let words = "<!doctype html><meta charset=\"utf-8\"><title>Rerun</title><p>The recording is being opened…</p>\
                 <p>正在打开记录…</p>";
    let mut response = Response::new(Body::new(Full::new(Bytes::from_static(words.as_bytes()))));
    *response.status_mut() = StatusCode::SERVICE_UNAVAILABLE;
    response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static("text/html; charset=utf-8"));
    response.headers_mut().insert(REFRESH, HeaderValue::from_static("1"));
    response
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
