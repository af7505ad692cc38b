//! What viewers read, out of Rerun's server and behind a door of ours.
//!
//! Messages reach Rerun's `MessageProxy` through the service that it offers to programs, without a connection: the client
//! calls the service itself. Viewers get the same service, but only to read.

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use hyper::body::Incoming;
use hyper::service::Service as _;
use hyper::{Request, StatusCode};
use hyper_util::service::TowerToHyperService;
use re_protos::sdk_comms::v1alpha1::WriteMessagesRequest;
use re_protos::sdk_comms::v1alpha1::message_proxy_service_client::MessageProxyServiceClient;
use re_protos::sdk_comms::v1alpha1::message_proxy_service_server::MessageProxyServiceServer;
use rerun::external::re_grpc_server::{MAX_DECODING_MESSAGE_SIZE, MAX_ENCODING_MESSAGE_SIZE, MessageProxy, cors_layer};
use rerun::external::re_log_encoding::ToTransport as _;
use rerun::external::re_log_encoding::rrd::Compression;
use rerun::log::{ChunkBatcherConfig, LogMsg};
use rerun::sink::{LogSink, SinkFlushError};
use rerun::{MemoryLimit, PlaybackBehavior, ServerOptions};
use tokio::sync::mpsc;
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::ReceiverStream;
use tonic_web::GrpcWebLayer;
use tower::Layer as _;

use super::Engine;
use handeye_http::door::{Door, Limits, plain};

/// What a viewer asks for; what else the service can do is to write into the recording.
pub(super) const READ: &str = "/rerun.sdk_comms.v1alpha1.MessageProxyService/ReadMessages";

/// Reads from a server without a connection.
pub(super) type Reader = MessageProxyServiceClient<MessageProxyServiceServer<MessageProxy>>;

/// Messages on their way to the server; an image is one.
const ON_THE_WAY: usize = 8;

/// Takes messages to a server.
pub struct ProxySink {
    to_server: mpsc::Sender<OnTheWay>,
    /// The server lives as long as somebody writes to it.
    _engine: Arc<Engine>,
}

enum OnTheWay {
    Message(Box<WriteMessagesRequest>),
    /// Everything before has arrived.
    Flush(SyncSender<()>),
}

/// Starts a server that keeps so many bytes for viewers that come later.
///
/// # Errors
/// When there is no port.
pub(super) fn serve(engine: &Arc<Engine>, limit_bytes: u64) -> io::Result<(ProxySink, Door, Reader)> {
    let runtime = engine.handle()?;
    let options = ServerOptions {
        playback_behavior: PlaybackBehavior::OldestFirst,
        memory_limit: MemoryLimit::from_bytes(limit_bytes),
        ..ServerOptions::default()
    };
    let _inside = runtime.enter();
    let service = MessageProxyServiceServer::new(MessageProxy::new(options))
        .max_decoding_message_size(MAX_DECODING_MESSAGE_SIZE)
        .max_encoding_message_size(MAX_ENCODING_MESSAGE_SIZE);

    let (to_server, messages) = mpsc::channel(ON_THE_WAY);
    let mut client = Reader::new(service.clone());
    let reader = client.clone().max_decoding_message_size(MAX_DECODING_MESSAGE_SIZE);
    runtime.spawn(async move {
        let messages = ReceiverStream::new(messages).filter_map(|it| match it {
            OnTheWay::Message(message) => Some(*message),
            OnTheWay::Flush(arrived) => {
                // Whoever asked may have gone.
                let _told = arrived.try_send(()).is_ok();
                None
            }
        });
        if let Err(error) = client.write_messages(messages).await {
            tracing::warn!(%error, "viewers get nothing new of the recording");
        }
    });

    // The page is served from another port, so that the browser asks whether it may read from this one.
    let service = TowerToHyperService::new(cors_layer(&[]).layer(GrpcWebLayer::new().layer(service)));
    let door = Door::open(runtime, Limits::USUAL, move |request: Request<Incoming>| {
        let asked = (request.uri().path() == READ).then(|| service.call(request));
        async move {
            let Some(answer) = asked else {
                return plain(StatusCode::NOT_FOUND, "Recordings are only read here.\n");
            };
            answer.await.unwrap_or_else(|never| match never {})
        }
    })?;
    Ok((ProxySink { to_server, _engine: Arc::clone(engine) }, door, reader))
}

impl LogSink for ProxySink {
    fn send(&self, message: LogMsg) {
        let message = match message.to_transport(Compression::LZ4) {
            Ok(message) => WriteMessagesRequest { log_msg: Some(message.into()) },
            Err(error) => {
                tracing::warn!(%error, "something was left out for viewers");
                return;
            }
        };
        if self.to_server.blocking_send(OnTheWay::Message(Box::new(message))).is_err() {
            tracing::debug!("a message came after the server has ended");
        }
    }

    fn flush_blocking(&self, timeout: Duration) -> Result<(), SinkFlushError> {
        let ended = || SinkFlushError::failed("the server for viewers has ended");
        let (arrived, arrival) = sync_channel(1);
        self.to_server.blocking_send(OnTheWay::Flush(arrived)).map_err(|_closed| ended())?;
        arrival.recv_timeout(timeout).map_err(|error| match error {
            RecvTimeoutError::Timeout => SinkFlushError::Timeout,
            RecvTimeoutError::Disconnected => ended(),
        })
    }

    fn default_batcher_config(&self) -> ChunkBatcherConfig {
        ChunkBatcherConfig::LOW_LATENCY
    }
}
