//! Rerun's server without a port of its own.
//!
//! Messages reach Rerun's `MessageProxy` through the service that it offers to programs, without a connection: the client
//! calls the service itself.

use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use re_protos::sdk_comms::v1alpha1::WriteMessagesRequest;
use re_protos::sdk_comms::v1alpha1::message_proxy_service_client::MessageProxyServiceClient;
use re_protos::sdk_comms::v1alpha1::message_proxy_service_server::MessageProxyServiceServer;
use rerun::external::re_grpc_server::{MAX_DECODING_MESSAGE_SIZE, MAX_ENCODING_MESSAGE_SIZE, MessageProxy};
use rerun::external::re_log_encoding::ToTransport as _;
use rerun::external::re_log_encoding::rrd::Compression;
use rerun::log::{ChunkBatcherConfig, LogMsg};
use rerun::sink::{LogSink, SinkFlushError};
use rerun::{MemoryLimit, ServerOptions};
use tokio::runtime::Runtime;
use tokio::sync::mpsc;
use tokio_stream::StreamExt as _;
use tokio_stream::wrappers::ReceiverStream;

/// Reads from a server without a connection.
pub(super) type Reader = MessageProxyServiceClient<MessageProxyServiceServer<MessageProxy>>;

/// Messages in flight to the server; an image is one.
const ON_THE_WAY: usize = 8;

/// Takes messages to a server.
pub(super) struct ProxySink(mpsc::Sender<ProxyMessage>);

enum ProxyMessage {
    Message(Box<WriteMessagesRequest>),
    /// Everything sent before has arrived.
    Flush(SyncSender<()>),
}

/// Starts a server that keeps this many bytes for viewers that come later.
pub(super) fn start(runtime: &Runtime, limit_bytes: u64) -> (ProxySink, Reader) {
    let _inside = runtime.enter();
    let options = ServerOptions { memory_limit: MemoryLimit::from_bytes(limit_bytes), ..ServerOptions::default() };
    let service = MessageProxyServiceServer::new(MessageProxy::new(options))
        .max_decoding_message_size(MAX_DECODING_MESSAGE_SIZE)
        .max_encoding_message_size(MAX_ENCODING_MESSAGE_SIZE);
    let (to_server, messages) = mpsc::channel(ON_THE_WAY);
    let mut client = Reader::new(service);
    let reader = client.clone().max_decoding_message_size(MAX_DECODING_MESSAGE_SIZE);
    runtime.spawn(async move {
        let messages = ReceiverStream::new(messages).filter_map(|it| match it {
            ProxyMessage::Message(message) => Some(*message),
            ProxyMessage::Flush(arrived) => {
                // The caller may be gone.
                let _sent = arrived.try_send(()).is_ok();
                None
            }
        });
        if let Err(error) = client.write_messages(messages).await {
            tracing::warn!(%error, "viewers get nothing new of the recording");
        }
    });
    (ProxySink(to_server), reader)
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
        if self.0.blocking_send(ProxyMessage::Message(Box::new(message))).is_err() {
            tracing::debug!("a message came after the server has ended");
        }
    }

    fn flush_blocking(&self, timeout: Duration) -> Result<(), SinkFlushError> {
        let (arrived, arrival) = sync_channel(1);
        // Once the server has ended nothing has to be waited for.
        let asked = self.0.blocking_send(ProxyMessage::Flush(arrived)).is_ok();
        match if asked { arrival.recv_timeout(timeout) } else { Ok(()) } {
            Err(RecvTimeoutError::Timeout) => Err(SinkFlushError::Timeout),
            Ok(()) | Err(RecvTimeoutError::Disconnected) => Ok(()),
        }
    }

    fn default_batcher_config(&self) -> ChunkBatcherConfig {
        ChunkBatcherConfig::LOW_LATENCY
    }
}
